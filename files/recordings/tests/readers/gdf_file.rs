//! Builds small GDF 1.25 and 2.20 files.

/// One signal: its header fields and the encoded samples of all records.
#[derive(Debug, Clone)]
pub(crate) struct GdfSignal {
    pub(crate) label: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) unit_code: u16,
    /// Physical minimum, physical maximum, digital minimum, digital maximum.
    pub(crate) ranges: [f64; 4],
    pub(crate) samples_per_record: u32,
    pub(crate) type_number: u32,
    pub(crate) data: Vec<u8>,
}

impl GdfSignal {
    /// Creates a signal of any GDF sample type with 1 uV per digital unit.
    pub(crate) fn with_type(type_number: u32, samples_per_record: u32, data: Vec<u8>) -> Self {
        let ranges = [-100.0, 100.0, -100.0, 100.0];
        let (label, unit, unit_code) = ("Cz", "uV", 4275);
        Self {
            label,
            unit,
            unit_code,
            ranges,
            samples_per_record,
            type_number,
            data,
        }
    }

    pub(crate) fn float32(label: &'static str, samples_per_record: u32, samples: &[f32]) -> Self {
        let data = samples
            .iter()
            .flat_map(|sample| sample.to_le_bytes())
            .collect();
        Self {
            label,
            ..Self::with_type(16, samples_per_record, data)
        }
    }
}

/// The header fields and signals of a file.
#[derive(Debug, Clone)]
pub(crate) struct GdfFile {
    pub(crate) version_1: bool,
    pub(crate) records: i64,
    pub(crate) duration: (u32, u32),
    pub(crate) signals: Vec<GdfSignal>,
    /// Bytes of the optional third header, between the header of the signals and the records.
    pub(crate) third_header: Vec<u8>,
    pub(crate) events: Vec<u8>,
}

impl GdfFile {
    pub(crate) fn version_2(records: i64, signals: Vec<GdfSignal>) -> Self {
        let (third_header, events) = (Vec::new(), Vec::new());
        Self {
            version_1: false,
            records,
            duration: (1, 1),
            signals,
            third_header,
            events,
        }
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
            let bytes = match signal.type_number {
                1 | 2 => 1,
                3 | 4 => 2,
                7 | 8 | 17 => 8,
                279 | 535 => 3,
                _ => 4,
            };
            signal.samples_per_record as usize * bytes
        };
        let records = self
            .signals
            .iter()
            .map(|s| s.data.len() / size(s).max(1))
            .max()
            .unwrap_or(0);
        for record in 0..records {
            for signal in &self.signals {
                let size = size(signal);
                out.extend_from_slice(&signal.data[record * size..(record + 1) * size]);
            }
        }
        out.extend_from_slice(&self.events);
        out
    }

    fn header(&self) -> Vec<u8> {
        let count = u16::try_from(self.signals.len()).expect("few signals");
        let mut out = if self.version_1 {
            b"GDF 1.25".to_vec()
        } else {
            b"GDF 2.20".to_vec()
        };
        out.resize(236, 0);
        out.extend(self.records.to_le_bytes());
        out.extend(self.duration.0.to_le_bytes());
        out.extend(self.duration.1.to_le_bytes());
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
