//! Max-pool, and two ways to undo it: unpooling to the positions of the maxima, or to the nearest
//! neighbours.

use artifact::{CONV2_CHANNELS, Geometry};

use super::{LANES, Lanes, Volume, product};

/// The output of a max-pool, and the position of each maximum.
#[derive(Clone, Debug)]
pub(crate) struct Pooled {
    /// Largest value of each pool, in the order channel, step, row, column, lane.
    pub(crate) values: Vec<Lanes>,
    /// Index of each maximum in its channel of the feature map.
    places: Vec<[u16; LANES]>,
}

/// Returns the max-pool of a feature map. Positions beyond the last whole pool are dropped; the
/// first of equal values is the maximum.
pub(crate) fn max_pool(x: &Volume, geometry: &Geometry) -> Pooled {
    let count = x.channels * product(geometry.pooled);
    let mut pooled =
        Pooled { values: Vec::with_capacity(count), places: Vec::with_capacity(count) };
    let members: Vec<Vec<usize>> = pools(geometry);
    for channel in x.by_channel() {
        for members in &members {
            let mut values = channel[members[0]];
            let mut places = [place(members[0]); LANES];
            for &member in &members[1..] {
                for lane in 0..LANES {
                    if channel[member][lane] > values[lane] {
                        values[lane] = channel[member][lane];
                        places[lane] = place(member);
                    }
                }
            }
            pooled.values.push(values);
            pooled.places.push(places);
        }
    }
    pooled
}

impl Pooled {
    /// Puts one value per pool at the position of the pool's maximum; all other positions are 0.
    /// This is both the gradient of the max-pool and the unpooling of mode `paper`.
    pub(crate) fn scatter(&self, values: &[Lanes], geometry: &Geometry) -> Volume {
        let mut x = Volume::zeros(CONV2_CHANNELS, geometry.feature_map);
        let per_channel = product(geometry.pooled);
        let pools = values.chunks_exact(per_channel);
        let pools = pools.zip(self.places.chunks_exact(per_channel));
        for (channel, (values, places)) in x.by_channel_mut().zip(pools) {
            for (value, places) in values.iter().zip(places) {
                for lane in 0..LANES {
                    channel[usize::from(places[lane])][lane] += value[lane];
                }
            }
        }
        x
    }

    /// Returns the values at the positions of the maxima: the backward pass of [`Self::scatter`].
    pub(crate) fn gather(&self, x: &Volume) -> Vec<Lanes> {
        let per_channel = self.places.len() / x.channels;
        let places = self.places.chunks_exact(per_channel);
        let mut values = Vec::with_capacity(self.places.len());
        for (channel, places) in x.by_channel().zip(places) {
            for places in places {
                values.push(std::array::from_fn(|lane| channel[usize::from(places[lane])][lane]));
            }
        }
        values
    }
}

/// Unpools to the feature map by nearest neighbour. For example, in the paper's network, the first
/// three of five columns take pooled column 0, and the last two take pooled column 1.
pub(crate) fn unpool(values: &[Lanes], geometry: &Geometry) -> Volume {
    let sources = nearest(geometry);
    let per_channel = product(geometry.pooled);
    let channels = values.chunks_exact(per_channel);
    let unpooled = channels.flat_map(|channel| sources.iter().map(|source| channel[*source]));
    Volume::from_values(CONV2_CHANNELS, geometry.feature_map, unpooled.collect())
}

/// Returns the gradient at the input of [`unpool`], from the gradient at its output.
pub(crate) fn unpool_gradient(gradient: &Volume, geometry: &Geometry) -> Vec<Lanes> {
    let sources = nearest(geometry);
    let per_channel = product(geometry.pooled);
    let mut values = vec![[0.0; LANES]; CONV2_CHANNELS * per_channel];
    for (sums, channel) in values.chunks_exact_mut(per_channel).zip(gradient.by_channel()) {
        for (source, gradient) in sources.iter().zip(channel) {
            for (sum, gradient) in sums[*source].iter_mut().zip(gradient) {
                *sum += gradient;
            }
        }
    }
    values
}

/// Returns, for each pool, the indices of its members in a channel of the feature map.
fn pools(geometry: &Geometry) -> Vec<Vec<usize>> {
    let (pooled, pool, map) = (geometry.pooled, geometry.pool, geometry.feature_map);
    places(pooled)
        .map(|[step, row, column]| {
            places(pool)
                .map(|[t, r, c]| {
                    let [step, row] = [step * pool[0] + t, row * pool[1] + r];
                    (step * map[1] + row) * map[2] + column * pool[2] + c
                })
                .collect()
        })
        .collect()
}

/// Returns, for each position of a channel of the feature map, the index of its nearest pool.
fn nearest(geometry: &Geometry) -> Vec<usize> {
    let (pooled, map) = (geometry.pooled, geometry.feature_map);
    places(map)
        .map(|place| {
            let [step, row, column] = [0, 1, 2].map(|axis| place[axis] * pooled[axis] / map[axis]);
            (step * pooled[1] + row) * pooled[2] + column
        })
        .collect()
}

/// Iterates over all positions of a volume, the column fastest.
fn places([steps, rows, columns]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..steps).flat_map(move |step| {
        (0..rows).flat_map(move |row| (0..columns).map(move |column| [step, row, column]))
    })
}

/// Returns an index of a value within a channel of a feature map as 16 bits; a channel has at most
/// 32 x 12 x 12 values.
#[expect(clippy::cast_possible_truncation, reason = "below 2^13")]
fn place(index: usize) -> u16 {
    index as u16
}
