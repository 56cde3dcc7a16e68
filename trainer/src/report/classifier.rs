//! Report of a classifier: patterns of its filters, and the accuracy of its decisions.

use super::Report;
use super::evaluation::places;
use crate::classify::{Course, Trained, chance, percent};
use crate::error::TrainerError;
use artifact::classifier::ClassifierFigures;
use picture::axis::{Axis, Scale};
use picture::canvas::{FAINT, INK, REFERENCE, RESULT, SOURCE};
use picture::lines::{Lines, Mark, Series};
use picture::page::csv_field;
use picture::patterns::Patterns;
use std::fmt::Write as _;
use std::iter;

/// Adds pictures of a classifier to a report.
pub(super) fn add(report: &mut Report, trained: &Trained) -> Result<(), TrainerError> {
    let classifier = &trained.classifier;
    let [low, high] = classifier.band.hz;
    let training = &classifier.training;
    report.page.push_text(&format!(
        "Classifier {:08x}, {low} to {high} Hz, trained on {}.",
        classifier.id(),
        training.train_files.join(", ")
    ));
    let patterns = patterns(trained);
    report.add_picture(
        "patterns",
        |path| patterns.draw(path),
        "Pattern of each filter: activity at the electrodes of the source that it extracts, relative \
         to the largest. The sign of a whole pattern means nothing.",
        &patterns_csv(trained),
    )?;
    let figures = [("Each left out in turn", &training.cross_validation), ("Test", &training.test)];
    for (title, figures) in figures {
        if let Some(figures) = figures {
            add_figures(report, trained, title, figures);
        }
    }
    let course = course(trained);
    report.add_picture(
        "probability",
        |path| course.draw(path),
        "Probability of the true class at each hop, mean over the trials of the class, by classifiers \
         that were not trained on them. The decision averages over the time before it.",
        &course_csv(trained),
    )
}

/// Adds the accuracy, overall and on each recording, and the trials by true class and decision.
fn add_figures(report: &mut Report, trained: &Trained, title: &str, figures: &ClassifierFigures) {
    let [low, high] = figures.accuracy_95.map(percent);
    report.page.push_text(&format!(
        "{title}: accuracy {} % (95 % interval {low} to {high} %, guesses {} %), AUC {} %. Trials \
         by true class and decision, and those of each recording:",
        percent(figures.accuracy),
        percent(chance(figures)),
        percent(figures.auc)
    ));
    let classes = trained.classifier.decision.classes.iter();
    let classes: Vec<String> = classes.map(|class| class.event.clone()).collect();
    let mut rows = vec![[vec!["true".to_owned()], classes.clone()].concat()];
    for (class, row) in classes.into_iter().zip(&figures.confusion) {
        let counts = row.iter().map(ToString::to_string);
        rows.push(iter::once(class).chain(counts).collect());
    }
    report.page.push_table(&rows);
    let head = ["recording", "trials", "right"].map(str::to_owned).to_vec();
    let parts = figures.parts.iter().map(|part| {
        let numbers = [part.trials, part.right].map(|number| number.to_string());
        [vec![part.name.clone()], numbers.to_vec()].concat()
    });
    let parts: Vec<Vec<String>> = iter::once(head).chain(parts).collect();
    report.page.push_table(&parts);
}

fn patterns(trained: &Trained) -> Patterns {
    let filters = &trained.classifier.filters;
    let classes = &trained.classifier.decision.classes;
    let per_class = filters.len() / classes.len();
    let patterns = filters.iter().enumerate().map(|(index, filter)| {
        let class = &classes[index / per_class].event;
        let values = filter.pattern.iter().map(|&value| f64::from(value));
        (format!("filter {}, strong in {class}", index + 1), values.collect())
    });
    let electrodes = trained.electrodes.iter();
    Patterns {
        places: places(electrodes.map(|(label, cell)| (label.as_str(), *cell))),
        patterns: patterns.collect(),
        title: "Patterns of the spatial filters".to_owned(),
        subtitle: "relative activity at the electrodes, seen from above, nose up".to_owned(),
    }
}

fn patterns_csv(trained: &Trained) -> String {
    let mut text = "filter,electrode,pattern,weight\n".to_owned();
    for (index, filter) in trained.classifier.filters.iter().enumerate() {
        let electrodes = trained.electrodes.iter().zip(&filter.pattern);
        for (((label, _), pattern), weight) in electrodes.zip(&filter.weights) {
            let _ = writeln!(text, "{},{},{pattern},{weight}", index + 1, csv_field(label));
        }
    }
    text
}

/// Returns the chart of the mean probability of the true class over time.
fn course(trained: &Trained) -> Lines {
    let classes = &trained.classifier.decision.classes;
    let colors = [SOURCE, RESULT, REFERENCE, INK].into_iter().cycle();
    let courses = classes.iter().zip(&trained.courses).zip(colors);
    let series = courses.map(|((class, course), color)| {
        Series::new(class.event.clone(), color, Mark::Line, course.clone())
    });
    let mut series: Vec<Series> = series.collect();
    let line = |label: &str, points| Series::new(label, FAINT, Mark::ThinLine, points);
    let [start_s, end_s] = trained.classifier.training.trial_s;
    let times: Vec<f64> = trained.courses.iter().flatten().map(|(seconds, _)| *seconds).collect();
    let ends = [times.first(), times.last()].into_iter().flatten();
    let equal = 1.0 / classes.len() as f64;
    series.extend([
        line("equal probability", ends.map(|seconds| (*seconds, equal)).collect()),
        line("event", vec![(0.0, 0.0), (0.0, 1.0)]),
        line("", vec![(end_s, 0.0), (end_s, 1.0)]),
    ]);
    Lines {
        title: "Probability of the true class".to_owned(),
        subtitle: format!(
            "mean over the trials of each class, left out of the training; trials are {start_s} to \
             {end_s} s after the event"
        ),
        x: Axis::new("time since the event (s)", Scale::Linear),
        y: Axis::new("probability", Scale::Linear),
        series,
    }
}

fn course_csv(trained: &Trained) -> String {
    let mut text = "class,seconds,probability\n".to_owned();
    let classes = trained.classifier.decision.classes.iter();
    for (class, course) in classes.zip(&trained.courses) {
        let course: &Course = course;
        for (seconds, probability) in course {
            let _ = writeln!(text, "{},{seconds},{probability}", csv_field(&class.event));
        }
    }
    text
}
