//! Positions of all agents, laid out for vector instructions.

use pulp::Simd;

/// Agents in a block.
pub(super) const LANES: usize = 8;

/// Positions in blocks of eight, the last one filled up with NaN: a comparison with NaN is false, so that what
/// is not there is never hit.
#[derive(Debug, Clone)]
pub(super) struct Positions {
    blocks: Vec<Block>,
}

/// Eight agents, one a lane.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Block {
    pub(super) x: [f64; LANES],
    pub(super) y: [f64; LANES],
}

impl FromIterator<[f64; 2]> for Positions {
    fn from_iter<I: IntoIterator<Item = [f64; 2]>>(positions: I) -> Self {
        let mut blocks = Vec::new();
        for (i, [x, y]) in positions.into_iter().enumerate() {
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
        Self { blocks }
    }
}

impl Positions {
    /// Position of agent `i`.
    #[inline(always)]
    pub(super) fn get(&self, i: usize) -> [f64; 2] {
        let block = &self.blocks[i / LANES];
        [block.x[i % LANES], block.y[i % LANES]]
    }

    /// Moves agent `i` by writing its whole block: the vector loads that follow at once can then be served from
    /// the store buffer, which a store of one lane would stall.
    #[inline(always)]
    pub(super) fn set<S: Simd>(&mut self, simd: S, i: usize, [x, y]: [f64; 2]) {
        let block = &mut self.blocks[i / LANES];
        let mine = simd.splat_u64s((i % LANES) as u64);
        let ids = S::as_simd_u64s(&IDS.0).0;
        for (values, value) in [(&mut block.x, x), (&mut block.y, y)] {
            for (old, &id) in S::as_mut_simd_f64s(values).0.iter_mut().zip(ids) {
                *old = simd.select_f64s(simd.equal_u64s(id, mine), simd.splat_f64s(value), *old);
            }
        }
    }

    #[inline(always)]
    pub(super) fn blocks(&self) -> &[Block] {
        &self.blocks
    }
}

#[repr(align(64))]
struct Ids([u64; LANES]);
static IDS: Ids = Ids([0, 1, 2, 3, 4, 5, 6, 7]);

impl Block {
    #[inline(always)]
    pub(super) fn vectors<S: Simd>(
        &self,
        simd: S,
        me: usize,
    ) -> impl Iterator<Item = ((S::f64s, S::f64s), S::m64s)> {
        let mine = simd.splat_u64s(me as u64);
        let xs = S::as_simd_f64s(&self.x).0;
        let ys = S::as_simd_f64s(&self.y).0;
        let ids = S::as_simd_u64s(&IDS.0).0;
        xs.iter().zip(ys).zip(ids).map(
            #[inline(always)]
            move |((&x, &y), &id)| ((x, y), simd.not_m64s(simd.equal_u64s(id, mine))),
        )
    }
}
