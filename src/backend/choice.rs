//! Which backend is faster for what: measured once, then looked up.

use std::time::Duration;

/// A stage of a transaction that a backend does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Edits applied to bricks.
    Edit,
    /// Blocks meshed.
    Mesh,
}

/// How long a stage may take on either backend.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Estimate {
    /// On the processor.
    pub cpu: Duration,
    /// On the card, uploads included.
    pub cuda: Duration,
}

/// What was chosen for a stage, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Of which stage.
    pub stage: Stage,
    /// Bricks that edits may reach, or blocks to be meshed.
    pub amount: usize,
    /// Bricks that the card does not have yet, roughly.
    pub missing: usize,
    /// What was expected; `None` where nothing is measured.
    pub estimate: Option<Estimate>,
    /// Was it the card?
    pub is_cuda: bool,
    /// How long it took.
    pub took: Duration,
    /// On the card: how long uploads and kernels took.
    pub device: Duration,
    /// On the card: how long the stage's kernel took.
    pub kernel: Duration,
}

/// Time by amount: measured at some amounts, linear between them and beyond.
#[derive(Clone, Debug, Default)]
#[cfg_attr(not(feature = "cuda"), expect(dead_code))]
pub(super) struct Curve {
    /// Amount and seconds, ascending.
    points: Vec<(f64, f64)>,
}

#[cfg_attr(not(feature = "cuda"), expect(dead_code))]
impl Curve {
    /// Takes in a measurement; amounts must ascend.
    pub fn push(&mut self, amount: usize, time: Duration) {
        // More never takes less time: what says otherwise is noise.
        let least = self.points.last().map_or(0.0, |point| point.1);
        self.points.push((amount as f64, time.as_secs_f64().max(least)));
    }

    /// Seconds for an amount.
    pub fn at(&self, amount: usize) -> f64 {
        let amount = amount as f64;
        match self.points.as_slice() {
            [] => 0.0,
            [only] => only.1 * (amount / only.0).max(1.0),
            points => {
                let above = points.partition_point(|point| point.0 < amount).clamp(1, points.len() - 1);
                let ((x0, y0), (x1, y1)) = (points[above - 1], points[above]);
                // Below the smallest amount it takes as long: that is what starting costs.
                y0 + (y1 - y0) * ((amount - x0) / (x1 - x0)).max(0.0)
            }
        }
    }
}

/// What both backends take, by measurement.
#[derive(Clone, Debug, Default)]
#[cfg_attr(not(feature = "cuda"), expect(dead_code))]
pub(super) struct Costs {
    /// Edits on the processor, on the card.
    pub edit: [Curve; 2],
    /// Meshing on the processor, on the card.
    pub mesh: [Curve; 2],
    /// Seconds to bring a brick to the card.
    pub upload: f64,
}

/// Blocks that are meshed anew for each brick that edits may reach, roughly.
#[cfg(feature = "cuda")]
const BLOCKS_PER_BRICK: f64 = 1.25;

#[cfg(feature = "cuda")]
impl Costs {
    /// The stages of a transaction are chosen one by one, but what is edited on the processor has to be brought to the
    /// card for meshing: so the card is charged less, or the processor more, for edits.
    pub fn edit(&self, bricks: usize, missing: usize) -> Estimate {
        let blocks = (bricks as f64 * BLOCKS_PER_BRICK) as usize;
        let (mesh, card) = (self.mesh[0].at(blocks), self.mesh[1].at(blocks));
        let brought = card + self.upload * bricks as f64;
        estimate(
            self.edit[0].at(bricks) + mesh.min(brought),
            self.edit[1].at(bricks) + self.upload * missing as f64 + card.min(mesh),
        )
    }

    /// Meshing blocks, when so many bricks are not on the card.
    pub fn mesh(&self, blocks: usize, missing: usize) -> Estimate {
        estimate(self.mesh[0].at(blocks), self.mesh[1].at(blocks) + self.upload * missing as f64)
    }
}

#[cfg(feature = "cuda")]
fn estimate(cpu: f64, cuda: f64) -> Estimate {
    let time = |seconds: f64| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
    Estimate { cpu: time(cpu), cuda: time(cuda) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_linear_between_what_was_measured() {
        let mut curve = Curve::default();
        assert_eq!(curve.at(10), 0.0);
        for (amount, micros) in [(10, 20), (20, 30), (40, 25), (80, 110)] {
            curve.push(amount, Duration::from_micros(micros));
        }
        let micros = |amount| (curve.at(amount) * 1e6).round();
        assert_eq!([1, 10, 15, 20, 30, 40].map(micros), [20.0, 20.0, 25.0, 30.0, 30.0, 30.0]);
        assert_eq!([60, 80, 160].map(micros), [70.0, 110.0, 270.0]);
    }
}
