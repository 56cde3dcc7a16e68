//! Memory of the virtual ADC.

use std::io::Cursor;

use super::*;
use crate::montage_map::Missing;

/// Builds an EDF file of two signals and `records` records of 1 s. Signal i has `rates[i]` samples
/// per record, all with the digital value 1.
fn two_rates(records: usize, rates: [usize; 2]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut put = |text: &str, width: usize| file.extend(format!("{text:width$}").bytes());
    put("0", 8);
    put("", 160);
    put("01.01.2400.00.00", 16);
    put("768", 8 + 44);
    put(&records.to_string(), 8);
    put("1", 8);
    put("2", 4);
    put("C3", 16);
    put("C4", 16);
    put("", 160);
    for field in ["uV", "-32768", "32767", "-32768", "32767"] {
        put(field, 8);
        put(field, 8);
    }
    put("", 160);
    for rate in rates {
        put(&rate.to_string(), 8);
    }
    put("", 64);
    let samples = records * (rates[0] + rates[1]);
    file.extend([1, 0].repeat(samples));
    file
}

#[test]
fn a_rate_group_that_is_ahead_buffers_only_a_few_blocks() {
    // The file lasts 20 minutes. At most 32,768 (512 and 160 Hz) and 47,348 samples (160 and 250 Hz)
    // were measured in memory; the limit below is 65,536. One block read from the file alone is 48 s
    // (24,576 outputs) or 79 s (40,448).
    const RECORDS: usize = 1200;
    for rates in [[512, 160], [160, 250]] {
        let bytes = two_rates(RECORDS, rates);
        let recording = Recording::from_source(Cursor::new(bytes)).expect("a sound file");
        let map = MontageMap::new(&recording.labels(), &["C3", "C4"], Missing::Refuse);
        let map = map.expect("both are there");
        let adc = VirtualAdc::new(recording, &map, AdcSpec::ads1299(512));
        let mut adc = adc.expect("usable").without_dither();
        let (mut most, mut delivered) = (0, 0);
        while let Some(counts) = adc.next() {
            // 1 uV is 44.7 counts of 22.35 nV, which rounds to 45.
            assert_eq!(counts.expect("readable")[..2], [45, 45]);
            most = most.max(adc.conversion.queued_samples());
            delivered += 1;
        }
        assert_eq!(delivered, RECORDS * 512);
        assert!(
            most < 65_536,
            "{rates:?}: {most} of {delivered} samples in memory"
        );
    }
}
