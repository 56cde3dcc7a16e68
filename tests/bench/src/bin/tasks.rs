//! Image that contains only the firmware's tasks `acquire` and `encode`. No path through them
//! allocates, and only the queue between them can panic: the report reads the source locations of
//! all reachable panics from the image.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

/// Prints what the program is for; a build for a PC does nothing else.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this image is linked, not run: `cargo xtask bench encoder`");
}

#[cfg(target_os = "none")]
mod image {
    use core::{
        future::{Future, poll_fn},
        hint::black_box,
        panic::PanicInfo,
        pin::pin,
        task::{Context, Poll, Waker},
    };

    use ads1299::{CHANNELS, Decoder, frame_bytes};
    use cortex_m_rt::entry;
    use device::{BothEncoders, CHIPS, Order, Producer, Run};
    use embassy_sync::zerocopy_channel::Channel;
    use firmware::{
        BulkSlot, Clock, Conversion, Converter, OutputSlot, RawMutex, SampleSlot, Shared, acquire,
        deadlines, encode, output_queue,
    };
    use pipeline::{Acquisition, Sample};
    use static_cell::{ConstStaticCell, StaticCell};

    static SHARED: Shared = Shared::new(Clock { now: || black_box(0), hz: 1_000_000 });

    static ENCODERS: ConstStaticCell<BothEncoders> = ConstStaticCell::new(BothEncoders::EMPTY);
    static PRODUCER: StaticCell<Producer<&'static mut BothEncoders>> = StaticCell::new();
    static ACQUISITION: StaticCell<Acquisition> = StaticCell::new();
    static SAMPLES: StaticCell<[SampleSlot; deadlines::SAMPLES_WAITING]> = StaticCell::new();
    static SAMPLE_CHANNEL: StaticCell<Channel<'static, RawMutex, SampleSlot>> = StaticCell::new();
    static OUTPUTS: ConstStaticCell<[OutputSlot; deadlines::OUTPUTS_WAITING]> =
        ConstStaticCell::new([OutputSlot::EMPTY; deadlines::OUTPUTS_WAITING]);
    static OUTPUT_CHANNEL: StaticCell<Channel<'static, RawMutex, OutputSlot>> = StaticCell::new();
    static BULK: ConstStaticCell<[BulkSlot; deadlines::BULK_WAITING]> =
        ConstStaticCell::new([const { BulkSlot::empty() }; deadlines::BULK_WAITING]);
    static BULK_CHANNEL: StaticCell<Channel<'static, RawMutex, BulkSlot>> = StaticCell::new();

    /// Converter whose frames the compiler cannot predict, so that it cannot optimise any path
    /// away.
    struct Unknown {
        decoder: Decoder<CHIPS>,
        counts: [[i32; CHANNELS]; CHIPS],
    }

    impl Converter for Unknown {
        /// Uses `poll_fn`, because an `async fn` would contain a panic for a poll after its
        /// completion.
        fn next(&mut self, sample: &mut Sample) -> impl Future<Output = Conversion> {
            poll_fn(|_| {
                let frame = black_box([0; frame_bytes(CHIPS)]);
                let status = self.decoder.decode(&frame, &mut self.counts);
                sample.counts.copy_from_slice(self.counts.as_flattened());
                Poll::Ready(Conversion {
                    status_bad: !status.is_sound(),
                    ..black_box(Conversion::default())
                })
            })
        }
    }

    #[entry]
    fn main() -> ! {
        let _ = run_tasks();
        sleep()
    }

    fn sleep() -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }

    /// Runs both tasks forever. Returns `None` if a static is already initialised, which cannot
    /// happen.
    fn run_tasks() -> Option<()> {
        let run = Run::NONE;
        SHARED.send_order(black_box(Order::Start(run)));
        let samples = SAMPLES.try_init_with(|| core::array::from_fn(|_| SampleSlot::default()))?;
        let samples = SAMPLE_CHANNEL.try_init(Channel::new(samples))?;
        let (samples_in, samples_out) = samples.split();
        let outputs = OUTPUT_CHANNEL.try_init(Channel::new(OUTPUTS.try_take()?))?;
        let bulk = BULK_CHANNEL.try_init(Channel::new(BULK.try_take()?))?;
        let (outputs_in, mut outputs_out) = output_queue(outputs, bulk);
        let acquisition = ACQUISITION.try_init_with(|| Acquisition::new(run.mains))?;
        let encoders = ENCODERS.try_take()?;
        let producer = PRODUCER.try_init_with(|| Producer::new(encoders))?;

        let unknown = Unknown { decoder: Decoder::new(), counts: [[0; CHANNELS]; CHIPS] };
        let mut acquiring = pin!(acquire(unknown, &SHARED, (samples_in, acquisition)));
        let mut encoding = pin!(encode(&SHARED, (samples_out, outputs_in, producer)));
        let mut context = Context::from_waker(Waker::noop());
        loop {
            let _ = acquiring.as_mut().poll(&mut context);
            let _ = encoding.as_mut().poll(&mut context);
            let is_received = match pin!(outputs_out.receive()).poll(&mut context) {
                Poll::Ready(output) => black_box(Some(output)).is_some(),
                Poll::Pending => false,
            };
            if is_received {
                outputs_out.receive_done();
            }
        }
    }

    /// Uses the panic's location, so that the image keeps the names of all source files with a
    /// reachable panic. An image that allocates does not link, because there is no allocator.
    #[panic_handler]
    fn panic(info: &PanicInfo) -> ! {
        black_box(info.location());
        sleep()
    }
}
