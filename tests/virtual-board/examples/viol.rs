use virtual_board::*;
fn main() {
    let mut args = std::env::args().skip(1);
    let model = match args.next().as_deref() { Some("f446") => Model::F446, _ => Model::H743 };
    let image = Image::read(args.next().unwrap().as_ref(), model).unwrap();
    let mut board = VirtualBoard::power_on(model, &image, &Setup::default()).unwrap();
    let mut last = 0;
    for us in (0..500_000).step_by(20) {
        board.run_until_us(us).unwrap();
        let v = board.converters().violations();
        if v != last { println!("{us}: {v} violations, sclk {}", board.sclk_hz()); last = v; }
    }
    for (at, e) in board.converters().events().iter().take(60) { println!("{at} {e:?}"); }
}
