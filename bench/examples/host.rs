//! The encoder on a PC, timed: `cargo xtask bench host` starts it and gives it its turns.
//!
//! In the current folder it reads [`host::COUNTS`] and writes the codes of all windows to
//! [`host::CODES`]. A line on its standard input is a turn of the contender of that name; the answer is
//! a line with the number of codes and the nanoseconds they took.
#![forbid(unsafe_code)]

use std::error::Error;
use std::hint::black_box;
use std::io::{self, BufRead, Write};
use std::time::Instant;
use std::{env, fs};

use bench::host;
use pipeline::{Acquisition, CHANNELS, Code, Encoder, Mains, Pipeline, Sample, Step};

fn main() -> Result<(), Box<dyn Error>> {
    let samples = samples(&fs::read(host::COUNTS)?);
    let mut acquisition = Acquisition::new(Mains::Hz50);
    let steps: Vec<Step> = samples
        .iter()
        .filter_map(|sample| acquisition.process_sample(sample))
        .collect();

    let streamed = streamed(&mut Encoder::new(), &steps);
    let windows = windows(&steps);
    let values = |codes: &[Code]| codes.iter().map(|code| code.values).collect::<Vec<_>>();
    if values(&streamed) != values(&windows) {
        return Err("the codes of a stream are not those of its windows one by one".into());
    }
    let values = streamed.iter().flat_map(|code| code.values.levels());
    fs::write(
        host::CODES,
        values.flat_map(i32::to_le_bytes).collect::<Vec<u8>>(),
    )?;
    println!("{}", env::consts::ARCH);

    let mut encoder = Encoder::new();
    let mut pipeline = Pipeline::new(Mains::Hz50);
    for turn in io::stdin().lock().lines() {
        let (codes, nanoseconds) = match turn?.as_str() {
            host::STREAMING => timed(|| self::streamed(&mut encoder, &steps).len()),
            host::WINDOWS => timed(|| self::windows(&steps).len()),
            host::PIPELINE => timed(|| {
                let pushed = samples
                    .iter()
                    .filter_map(|sample| pipeline.encode_sample(sample));
                pushed.map(black_box).count()
            }),
            other => return Err(format!("there is no contender {other:?}").into()),
        };
        println!("{codes} {nanoseconds}");
        io::stdout().flush()?;
    }
    Ok(())
}

/// Does it until the turn is over: codes, and nanoseconds that they took.
fn timed(mut codes: impl FnMut() -> usize) -> (usize, u128) {
    let begin = Instant::now();
    let mut all = 0;
    while begin.elapsed() < host::TURN {
        all += codes();
    }
    (all, begin.elapsed().as_nanos())
}

fn streamed(encoder: &mut Encoder, steps: &[Step]) -> Vec<Code> {
    let codes = steps.iter().filter_map(|step| encoder.encode_step(step));
    codes.map(black_box).collect()
}

/// Each window from an encoder that has seen nothing, as if there were no overlap.
fn windows(steps: &[Step]) -> Vec<Code> {
    let windows = steps.windows(model::STEPS).step_by(model::HOP);
    windows
        .filter_map(|window| streamed(&mut Encoder::new(), window).pop())
        .collect()
}

/// Counts of 32 bits, little endian, channel by channel.
fn samples(bytes: &[u8]) -> Vec<Sample> {
    let counts: Vec<i32> = bytes
        .as_chunks()
        .0
        .iter()
        .map(|&count| i32::from_le_bytes(count))
        .collect();
    let samples = counts.as_chunks::<CHANNELS>().0;
    samples.iter().map(|&counts| Sample { counts }).collect()
}
