//! Lower convex hull of points (device time, host time), for the fit of a clock's drift.

/// Device time at which a frame was made and host time at which it was read, both in microseconds
/// since an origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) device: f64,
    pub(crate) host: f64,
}

/// Returns the slope of the line that has the least mean distance to the points among all lines
/// below them. That line is the edge of the lower convex hull that spans the mean device time.
///
/// `points` must be sorted by device time, as Andrew's monotone chain algorithm needs them. Returns
/// 1 if there are fewer than two distinct device times.
pub(crate) fn slope_at_middle(points: &[Point]) -> f64 {
    let mut hull: Vec<Point> = Vec::with_capacity(points.len());
    for &point in points {
        while let [.., a, b] = hull.as_slice() {
            let turns_up = (b.device - a.device) * (point.host - a.host)
                > (b.host - a.host) * (point.device - a.device);
            if turns_up {
                break;
            }
            hull.pop();
        }
        hull.push(point);
    }
    #[expect(clippy::cast_precision_loss, reason = "a hundred points")]
    let middle = points.iter().map(|point| point.device).sum::<f64>() / points.len() as f64;
    let edges = hull.iter().zip(hull.iter().skip(1));
    let mut edges = edges.filter(|(a, b)| b.device > a.device);
    let edge = edges
        .clone()
        .find(|(_, b)| b.device >= middle)
        .or_else(|| edges.next_back());
    edge.map_or(1.0, |(a, b)| (b.host - a.host) / (b.device - a.device))
}

#[cfg(test)]
mod tests {
    use super::{Point, slope_at_middle};

    fn slope(points: &[(f64, f64)]) -> f64 {
        let points: Vec<Point> = points
            .iter()
            .map(|&(device, host)| Point { device, host })
            .collect();
        slope_at_middle(&points)
    }

    #[test]
    fn points_above_the_hull_do_not_change_the_slope() {
        let cloud = [
            (0.0, 0.0),
            (1.0, 9.0),
            (2.0, 4.0),
            (3.0, 3.9),
            (4.0, 8.0),
            (5.0, 9.0),
        ];
        assert!((slope(&cloud) - 1.3).abs() < 1e-12);
    }

    #[test]
    fn too_few_points_have_the_slope_of_equal_clocks() {
        for points in [&[][..], &[(3.0, 7.0)], &[(3.0, 7.0), (3.0, 8.0)]] {
            assert!((slope(points) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_bent_hull_has_the_slope_of_its_middle() {
        let bend = [(0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 5.0), (4.0, 7.0)];
        assert!((slope(&bend) - 2.0).abs() < 1e-12);
    }
}
