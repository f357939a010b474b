//! Positions of all agents, laid out for vector instructions.

use pulp::Simd;

/// Number of agents in a block.
pub(super) const LANES: usize = 8;

/// Positions in blocks of eight. NaN fills up the last block: comparisons with NaN are false, so empty lanes are never hit.
#[derive(Debug, Clone)]
pub(super) struct Positions {
    blocks: Vec<Block>,
    count: usize,
}

/// Eight agents, one per lane; aligned so that no vector straddles two cache lines.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Block {
    x: [f64; LANES],
    y: [f64; LANES],
}

/// The agents in one vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lanes<S: Simd> {
    pub(super) x: S::f64s,
    pub(super) y: S::f64s,
    /// All lanes except the lane that is left out.
    pub(super) other: S::m64s,
}

#[repr(align(64))]
struct LaneNumbers([u64; LANES]);

static LANE_NUMBERS: LaneNumbers = LaneNumbers([0, 1, 2, 3, 4, 5, 6, 7]);

impl FromIterator<[f64; 2]> for Positions {
    fn from_iter<I: IntoIterator<Item = [f64; 2]>>(positions: I) -> Self {
        let mut blocks = Vec::new();
        let mut count = 0;
        for (i, [x, y]) in positions.into_iter().enumerate() {
            count += 1;
            if i % LANES == 0 {
                blocks.push(Block {
                    x: [f64::NAN; LANES],
                    y: [f64::NAN; LANES],
                });
            }
            let block = &mut blocks[i / LANES];
            block.x[i % LANES] = x;
            block.y[i % LANES] = y;
        }
        Self { blocks, count }
    }
}

impl Positions {
    #[inline(always)]
    pub(super) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Number of agents.
    pub(super) const fn count(&self) -> usize {
        self.count
    }

    /// Position of agent `i`.
    #[inline(always)]
    pub(super) fn get(&self, i: usize) -> [f64; 2] {
        let block = &self.blocks[i / LANES];
        [block.x[i % LANES], block.y[i % LANES]]
    }

    /// Moves agent `i` by writing its whole block: vector loads that follow immediately can then be served from the store buffer.
    /// After a store of a single lane, such loads would stall.
    #[inline(always)]
    pub(super) fn set<S: Simd>(&mut self, simd: S, i: usize, [x, y]: [f64; 2]) {
        let block = &mut self.blocks[i / LANES];
        let lane = simd.splat_u64s((i % LANES) as u64);
        let numbers = S::as_simd_u64s(&LANE_NUMBERS.0).0;
        for (values, value) in [(&mut block.x, x), (&mut block.y, y)] {
            let value = simd.splat_f64s(value);
            for (old, &number) in S::as_mut_simd_f64s(values).0.iter_mut().zip(numbers) {
                *old = simd.select_f64s(simd.equal_u64s(number, lane), value, *old);
            }
        }
    }
}

impl Block {
    /// The block as vectors, with lane `left_out` masked. If `left_out` is beyond the block, no lane is masked.
    #[inline(always)]
    pub(super) fn vectors<S: Simd>(&self, simd: S, left_out: usize) -> impl Iterator<Item = Lanes<S>> {
        let left_out = simd.splat_u64s(left_out as u64);
        let xs = S::as_simd_f64s(&self.x).0.iter();
        let ys = S::as_simd_f64s(&self.y).0;
        let numbers = S::as_simd_u64s(&LANE_NUMBERS.0).0;
        xs.zip(ys).zip(numbers).map(
            #[inline(always)]
            move |((&x, &y), &number)| Lanes {
                x,
                y,
                other: simd.not_m64s(simd.equal_u64s(number, left_out)),
            },
        )
    }

    /// Like [`Block::vectors`], but also masks lanes outside `first..end`.
    #[inline(always)]
    pub(super) fn members<S: Simd>(
        &self,
        simd: S,
        left_out: usize,
        [first, end]: [usize; 2],
    ) -> impl Iterator<Item = Lanes<S>> {
        let [first, end] = [simd.splat_u64s(first as u64), simd.splat_u64s(end as u64)];
        let numbers = S::as_simd_u64s(&LANE_NUMBERS.0).0;
        self.vectors(simd, left_out).zip(numbers).map(
            #[inline(always)]
            move |(lanes, &number)| {
                let before = simd.less_than_u64s(number, first);
                let member = simd.and_m64s(simd.not_m64s(before), simd.less_than_u64s(number, end));
                Lanes {
                    other: simd.and_m64s(lanes.other, member),
                    ..lanes
                }
            },
        )
    }
}
