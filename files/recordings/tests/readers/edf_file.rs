//! Builds small EDF, EDF+ and BDF files.

/// One signal: its header fields and the samples or annotation bytes of all records.
#[derive(Debug, Clone)]
pub(crate) struct EdfSignal {
    pub(crate) label: &'static str,
    pub(crate) unit: &'static str,
    /// Physical minimum, physical maximum, digital minimum, digital maximum, as text.
    pub(crate) ranges: [String; 4],
    pub(crate) samples_per_record: usize,
    pub(crate) data: Vec<u8>,
}

impl EdfSignal {
    /// Creates a signal of 16-bit samples with 1 uV per digital unit.
    pub(crate) fn int16(label: &'static str, samples_per_record: usize, samples: &[i16]) -> Self {
        let ranges = ["-32768", "32767", "-32768", "32767"].map(str::to_owned);
        let data = samples
            .iter()
            .flat_map(|sample| sample.to_le_bytes())
            .collect();
        Self {
            label,
            unit: "uV",
            ranges,
            samples_per_record,
            data,
        }
    }

    /// Creates an annotation signal with one list per record, padded to 60 bytes.
    pub(crate) fn annotations(lists: &[&[u8]]) -> Self {
        let mut signal = Self::int16("EDF Annotations", 30, &[]);
        for list in lists {
            signal.data.extend_from_slice(list);
            signal
                .data
                .resize(signal.data.len().next_multiple_of(60), 0);
        }
        signal
    }
}

/// The header fields and signals of a file.
#[derive(Debug, Clone)]
pub(crate) struct EdfFile {
    /// First eight bytes of the file, which identify the format.
    pub(crate) magic: [u8; 8],
    /// Reserved field, such as `EDF+C`.
    pub(crate) reserved: &'static str,
    pub(crate) records: &'static str,
    pub(crate) duration: &'static str,
    pub(crate) sample_bytes: usize,
    pub(crate) signals: Vec<EdfSignal>,
}

impl EdfFile {
    pub(crate) fn edf(records: &'static str, signals: Vec<EdfSignal>) -> Self {
        let magic = *b"0       ";
        Self {
            magic,
            reserved: "",
            records,
            duration: "1",
            sample_bytes: 2,
            signals,
        }
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
            self.signals
                .iter()
                .for_each(|signal| put(&signal.ranges[range], 8));
        }
        self.signals.iter().for_each(|_| put("", 80));
        self.signals
            .iter()
            .for_each(|signal| put(&signal.samples_per_record.to_string(), 8));
        self.signals.iter().for_each(|_| put("", 32));
        let size = |signal: &EdfSignal| signal.samples_per_record * self.sample_bytes;
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
        out
    }
}
