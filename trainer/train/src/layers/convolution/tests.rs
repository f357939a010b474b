//! Compares the loops of a convolution with and without vectors.

use super::*;
use pulp::Scalar;

fn noise(count: usize) -> Vec<f32> {
    let noise = |i: u32| (i.wrapping_mul(2_654_435_761) >> 16) as f32 / 32_768.0 - 1.0;
    (1..=count as u32).map(noise).collect()
}

/// Values and gradients of three samples, with the vectors of this CPU and without vectors.
fn both(channels: usize) -> [Vec<f32>; 2] {
    let input = Shape { channels: 3, side: 8 };
    let output = Shape { channels, side: 4 };
    let layer = Convolution::new(input, output, 3, 2, 1);
    let (values, first) = (noise(3 * input.len()), noise(WIDTH));
    let (weights, gradient) = (noise(27 * WIDTH), noise(3 * output.pixels() * WIDTH));
    [true, false].map(|vectors| {
        let mut target = vec![0.0; 3 * output.len()];
        let gather = Gather {
            groups: &layer.meetings.outputs,
            samples: 3,
            source: &values,
            weights: &weights,
            first: &first,
            channels,
            target: &mut target,
        };
        let (mut sums, mut alone) = (vec![0.0; 27 * WIDTH], vec![0.0; WIDTH]);
        let products = Products {
            strips: &layer.meetings.strips,
            samples: 3,
            values: &values,
            gradient: &gradient,
            channels: WIDTH,
            sums: &mut sums,
            alone: &mut alone,
        };
        if vectors {
            Arch::new().dispatch(gather);
            Arch::new().dispatch(products);
        } else {
            pulp::Simd::vectorize(Scalar, gather);
            pulp::Simd::vectorize(Scalar, products);
        }
        [target, sums, alone].concat()
    })
}

#[test]
fn the_bits_do_not_depend_on_the_width_of_vectors() {
    for channels in [1, 5, 16] {
        let [vectors, alone] = both(channels);
        assert!(vectors.iter().any(|&value| value != 0.0));
        assert_eq!(vectors, alone, "{channels} channels");
    }
}
