//! Builds small EDF, EDF+, BDF and GDF files for the tests.

use recordings::SampleType;

/// Appends all records. `signals` holds, for each signal, the number of bytes per record and the
/// data for all records.
fn append_records(out: &mut Vec<u8>, signals: &[(usize, &[u8])]) {
    let records = signals.iter().map(|(size, data)| data.len() / size.max(&1));
    for record in 0..records.max().unwrap_or(0) {
        for (size, data) in signals {
            out.extend_from_slice(&data[record * size..(record + 1) * size]);
        }
    }
}

/// A signal of an EDF file: its header fields and its samples or annotation bytes for all records.
#[derive(Debug, Clone)]
pub(crate) struct EdfSignal {
    pub(crate) label: &'static str,
    pub(crate) unit: &'static str,
    /// Physical minimum and maximum, digital minimum and maximum, as text.
    pub(crate) ranges: [String; 4],
    pub(crate) samples_per_record: usize,
    pub(crate) data: Vec<u8>,
}

impl EdfSignal {
    /// Creates a signal of 16-bit samples with 1 uV per digital unit.
    pub(crate) fn int16(label: &'static str, samples_per_record: usize, samples: &[i16]) -> Self {
        let ranges = ["-32768", "32767", "-32768", "32767"].map(str::to_owned);
        let data = samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
        Self { label, unit: "uV", ranges, samples_per_record, data }
    }

    /// Creates an annotation signal with one annotation list for each record, padded to 60 bytes.
    pub(crate) fn annotations(lists: &[&[u8]]) -> Self {
        let mut signal = Self::int16("EDF Annotations", 30, &[]);
        for list in lists {
            signal.data.extend_from_slice(list);
            signal.data.resize(signal.data.len().next_multiple_of(60), 0);
        }
        signal
    }
}

/// The header fields and signals of an EDF, EDF+ or BDF file.
#[derive(Debug, Clone)]
pub(crate) struct EdfFile {
    /// First eight bytes of the file, which identify the format.
    pub(crate) magic: [u8; 8],
    /// Reserved field of the header, such as `EDF+C`.
    pub(crate) reserved: &'static str,
    pub(crate) records: &'static str,
    pub(crate) duration: &'static str,
    pub(crate) sample_bytes: usize,
    pub(crate) signals: Vec<EdfSignal>,
}

impl EdfFile {
    pub(crate) fn edf(records: &'static str, signals: Vec<EdfSignal>) -> Self {
        Self { magic: *b"0       ", reserved: "", records, duration: "1", sample_bytes: 2, signals }
    }

    /// Creates a BDF file of one signal `Cz` with `samples_per_record` samples of 3 bytes each.
    pub(crate) fn bdf(records: &'static str, samples_per_record: usize, data: Vec<u8>) -> Self {
        let signal = EdfSignal {
            ranges: ["-8388608", "8388607", "-8388608", "8388607"].map(str::to_owned),
            data,
            ..EdfSignal::int16("Cz", samples_per_record, &[])
        };
        Self { magic: *b"\xffBIOSEMI", sample_bytes: 3, ..Self::edf(records, vec![signal]) }
    }

    /// Creates an EDF+ file of one signal `Cz` and one annotation list for each record. `reserved`
    /// is `EDF+C` or `EDF+D`.
    pub(crate) fn edf_plus(
        reserved: &'static str,
        records: &'static str,
        (samples_per_record, samples): (usize, &[i16]),
        lists: &[&[u8]],
    ) -> Self {
        let signal = EdfSignal::int16("Cz", samples_per_record, samples);
        Self { reserved, ..Self::edf(records, vec![signal, EdfSignal::annotations(lists)]) }
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let count = self.signals.len();
        let mut out = self.magic.to_vec();
        let mut put = |text: &str, width: usize| {
            assert!(text.len() <= width, "{text:?} does not fit {width} bytes");
            out.extend(format!("{text:width$}").bytes());
        };
        put("X X X X", 80);
        put("Startdate 01-JAN-2024 X X X", 80);
        put("01.01.2400.00.00", 16);
        put(&(256 * (1 + count)).to_string(), 8);
        put(self.reserved, 44);
        put(self.records, 8);
        put(self.duration, 8);
        put(&count.to_string(), 4);
        self.signals.iter().for_each(|signal| put(signal.label, 16));
        self.signals.iter().for_each(|_| put("AgAgCl", 80));
        self.signals.iter().for_each(|signal| put(signal.unit, 8));
        for range in 0..4 {
            self.signals.iter().for_each(|signal| put(&signal.ranges[range], 8));
        }
        self.signals.iter().for_each(|_| put("", 80));
        self.signals.iter().for_each(|signal| put(&signal.samples_per_record.to_string(), 8));
        self.signals.iter().for_each(|_| put("", 32));
        let signals = self.signals.iter();
        let parts = signals.map(|s| (s.samples_per_record * self.sample_bytes, &*s.data));
        append_records(&mut out, &parts.collect::<Vec<_>>());
        out
    }
}

/// A signal of a GDF file: its header fields and its encoded samples for all records.
#[derive(Debug, Clone)]
pub(crate) struct GdfSignal {
    pub(crate) label: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) unit_code: u16,
    /// Physical minimum and maximum, digital minimum and maximum.
    pub(crate) ranges: [f64; 4],
    pub(crate) samples_per_record: u32,
    pub(crate) type_number: u32,
    pub(crate) data: Vec<u8>,
}

impl GdfSignal {
    /// Creates a signal of any GDF sample type with 1 uV per digital unit.
    pub(crate) fn with_type(type_number: u32, samples_per_record: u32, data: Vec<u8>) -> Self {
        Self {
            label: "Cz",
            unit: "uV",
            unit_code: 4275,
            ranges: [-100.0, 100.0, -100.0, 100.0],
            samples_per_record,
            type_number,
            data,
        }
    }
}

/// The header fields and signals of a GDF file.
#[derive(Debug, Clone)]
pub(crate) struct GdfFile {
    pub(crate) version_1: bool,
    /// Version, unless `version_1` makes it 1.25.
    pub(crate) version: &'static str,
    pub(crate) records: i64,
    /// Duration of a record in versions before 2.21, s: numerator and denominator.
    pub(crate) duration: (u32, u32),
    /// Duration of a record in version 2.21 and later, s.
    pub(crate) length_s: f64,
    pub(crate) signals: Vec<GdfSignal>,
    /// Optional third header, between the header's part for the signals and the records.
    pub(crate) third_header: Vec<u8>,
    pub(crate) events: Vec<u8>,
}

impl GdfFile {
    pub(crate) fn version_2(records: i64, signals: Vec<GdfSignal>) -> Self {
        Self {
            version_1: false,
            version: "2.20",
            records,
            duration: (1, 1),
            length_s: 1.0,
            signals,
            third_header: Vec::new(),
            events: Vec::new(),
        }
    }

    /// Creates a file of one float32 signal `Cz` with 1 uV per digital unit, in records of 1 s.
    pub(crate) fn float32(records: i64, samples_per_record: u32, samples: &[f32]) -> Self {
        let data = samples.iter().flat_map(|sample| sample.to_le_bytes());
        let signal = GdfSignal::with_type(16, samples_per_record, data.collect());
        Self::version_2(records, vec![signal])
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut out = self.header();
        out.extend_from_slice(&self.third_header);
        out.resize(out.len().next_multiple_of(256), 0);
        let length = out.len();
        if self.version_1 {
            out[184..192].copy_from_slice(&(length as u64).to_le_bytes());
        } else {
            let blocks = u16::try_from(length / 256).expect("a small header");
            out[184..186].copy_from_slice(&blocks.to_le_bytes());
        }
        let size = |signal: &GdfSignal| {
            let bytes = SampleType::from_gdf(signal.type_number).map_or(4, SampleType::bytes);
            signal.samples_per_record as usize * bytes
        };
        let parts = self.signals.iter().map(|signal| (size(signal), &*signal.data));
        append_records(&mut out, &parts.collect::<Vec<_>>());
        out.extend_from_slice(&self.events);
        out
    }

    fn header(&self) -> Vec<u8> {
        let count = u16::try_from(self.signals.len()).expect("few signals");
        let version = if self.version_1 { "1.25" } else { self.version };
        let mut out = format!("GDF {version}").into_bytes();
        out.resize(236, 0);
        out.extend(self.records.to_le_bytes());
        if version > "2.20" {
            out.extend(self.length_s.to_le_bytes());
        } else {
            out.extend([self.duration.0, self.duration.1].map(u32::to_le_bytes).concat());
        }
        out.extend(count.to_le_bytes());
        out.resize(256, 0);
        let padded = |text: &str, width: usize| {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(width, 0);
            bytes
        };
        let mut column = |field: &dyn Fn(&GdfSignal) -> Vec<u8>| {
            out.extend(self.signals.iter().flat_map(field));
        };
        column(&|signal| padded(signal.label, 16));
        column(&|_| vec![0; 80]);
        if self.version_1 {
            column(&|signal| padded(signal.unit, 8));
        } else {
            column(&|signal| padded(signal.unit, 6));
            column(&|signal| signal.unit_code.to_le_bytes().to_vec());
        }
        for range in 0..4 {
            column(&|signal| {
                let value = signal.ranges[range];
                if self.version_1 && range >= 2 {
                    #[expect(clippy::cast_possible_truncation, reason = "small whole numbers")]
                    return (value as i64).to_le_bytes().to_vec();
                }
                value.to_le_bytes().to_vec()
            });
        }
        column(&|_| vec![0; 80]);
        column(&|signal| signal.samples_per_record.to_le_bytes().to_vec());
        column(&|signal| signal.type_number.to_le_bytes().to_vec());
        column(&|_| vec![0; 32]);
        out
    }
}

/// Encodes an event table of mode 1 from pairs (position, type).
pub(crate) fn event_table(rate_hz: f32, events: &[(u32, u16)]) -> Vec<u8> {
    let count = u32::try_from(events.len()).expect("few events").to_le_bytes();
    let mut table = vec![1, count[0], count[1], count[2]];
    table.extend(rate_hz.to_le_bytes());
    table.extend(events.iter().flat_map(|(position, _)| position.to_le_bytes()));
    table.extend(events.iter().flat_map(|(_, label)| label.to_le_bytes()));
    table
}
