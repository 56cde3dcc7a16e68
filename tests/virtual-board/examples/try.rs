use virtual_board::*;
fn main() {
    let mut args = std::env::args().skip(1);
    let model = match args.next().as_deref() { Some("f446") => Model::F446, _ => Model::H743 };
    let image = Image::read(args.next().unwrap().as_ref(), model).unwrap();
    let ms: u64 = args.next().map_or(2000, |a| a.parse().unwrap());
    let mut board = VirtualBoard::power_on(model, &image, &Setup::default()).unwrap();
    let begin = std::time::Instant::now();
    board.run_until_us(600_000).unwrap();
    board.send(&link::ToDevice::Start(link::Start { streams: link::Streams::CODES, mains_hz: 0 }));
    board.plan_trigger(&[(1_000_000, true), (1_100_003, false)]);
    if let Err(e) = board.run_until_us(ms * 1000) { println!("{e}"); }
    println!("{:.2} s real, baud {:?}, sclk {}, violations {} bytes {} odd {}", begin.elapsed().as_secs_f64(), board.port().baud(), board.sclk_hz(), board.converters().violations(), board.spi_bytes(), board.odd_words());
    for f in board.inbox().frames() { let t = format!("{f:?}"); println!("{}", &t[..t.len().min(260)]); }
    println!("{}", board.diagnosis());
    println!("{:?}", board.findings().unwrap());
}
