use virtual_board::*;
fn main() {
    let mut args = std::env::args().skip(1);
    let model = match args.next().as_deref() { Some("f446") => Model::F446, _ => Model::H743 };
    let image = Image::read(args.next().unwrap().as_ref(), model).unwrap();
    let mut board = VirtualBoard::power_on(model, &image, &Setup::default()).unwrap();
    let mut last = (0, 0, 0);
    board.run_until_us(380_000).unwrap();
    for us in (380_000..402_000).step_by(20) {
        board.run_until_us(us).unwrap();
        let now = (board.converters().ready_edges(), board.spi_bytes(), board.sclk_hz());
        if now != last { println!("{us}: edges {} bytes {} sclk {}", now.0, now.1, now.2); last = now; }
    }
}
