//! Builds EDF and EDF+ files whose signals are ramps.

/// Number of samples of a signal in a record of 1 s.
pub(crate) const RATE: usize = 128;

/// One signal of 16-bit samples.
#[derive(Debug, Clone)]
pub(crate) struct Signal {
    pub(crate) label: String,
    /// Digital minimum and maximum, as the texts of the header.
    pub(crate) digital: [&'static str; 2],
    pub(crate) samples_per_record: usize,
}

impl Signal {
    pub(crate) fn new(label: &str) -> Self {
        Self { label: label.to_owned(), digital: ["-32768", "32767"], samples_per_record: RATE }
    }
}

/// Content of an EDF file whose records are 1 s long.
#[derive(Debug, Clone)]
pub(crate) struct EdfFile {
    pub(crate) signals: Vec<Signal>,
    pub(crate) records: usize,
    /// Annotation lists of each record, such as `+0\x14\x14`; none for a plain EDF file.
    pub(crate) annotations: Vec<&'static [u8]>,
}

/// Size of a record's annotations, in bytes.
const ANNOTATION_BYTES: usize = 80;

impl EdfFile {
    /// Creates a plain EDF file with the electrodes of the model.
    pub(crate) fn with_all_electrodes(records: usize) -> Self {
        Self::with_labels(records, &model::LABELS.split(' ').collect::<Vec<_>>())
    }

    pub(crate) fn with_labels(records: usize, labels: &[&str]) -> Self {
        Self {
            signals: labels.iter().map(|label| Signal::new(label)).collect(),
            records,
            annotations: Vec::new(),
        }
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut signals = self.signals.clone();
        if !self.annotations.is_empty() {
            signals.push(Signal {
                samples_per_record: ANNOTATION_BYTES / 2,
                ..Signal::new("EDF Annotations")
            });
        }
        let mut out = Vec::new();
        let mut put = |text: &str, width: usize| out.extend(format!("{text:width$}").bytes());
        put("0", 8);
        put("X X X X", 80);
        put("Startdate 01-JAN-2024 X X X", 80);
        put("01.01.2400.00.00", 16);
        put(&(256 * (1 + signals.len())).to_string(), 8);
        put(if self.annotations.is_empty() { "" } else { "EDF+C" }, 44);
        put(&self.records.to_string(), 8);
        put("1", 8);
        put(&signals.len().to_string(), 4);
        let mut column = |width: usize, field: &dyn Fn(&Signal) -> String| {
            for signal in &signals {
                put(&field(signal), width);
            }
        };
        column(16, &|signal| signal.label.clone());
        column(80, &|_| "AgAgCl".to_owned());
        column(8, &|_| "uV".to_owned());
        column(8, &|_| "-32768".to_owned());
        column(8, &|_| "32767".to_owned());
        column(8, &|signal| signal.digital[0].to_owned());
        column(8, &|signal| signal.digital[1].to_owned());
        column(80, &|_| String::new());
        column(8, &|signal| signal.samples_per_record.to_string());
        column(32, &|_| String::new());
        for record in 0..self.records {
            for (number, signal) in self.signals.iter().enumerate() {
                for sample in 0..signal.samples_per_record {
                    // Each signal is a ramp from -500 to 499 with a different period.
                    let at = record * RATE + sample;
                    let value = i16::try_from(at * (3 + number) % 1000).expect("below 1000");
                    out.extend((value - 500).to_le_bytes());
                }
            }
            if let Some(lists) = self.annotations.get(record) {
                let end = out.len() + ANNOTATION_BYTES;
                out.extend_from_slice(lists);
                out.resize(end, 0);
            }
        }
        out
    }
}
