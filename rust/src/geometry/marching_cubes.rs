//! Area of the surface that marching cubes lays half-way between two phases, without the surface.
//!
//! Between voxels of two values the surface has only 256 shapes, each in the cube between eight
//! voxel centres. They are the turned and mirrored forms of the shapes here. Where diagonal voxels
//! of a face are solid and the other two are not, the solid hangs together (Lewiner et al. 2003).

use super::configurations::PATTERNS;

/// Corners of a triangle in a cube: the octal digits are (z, y, x) in half edges.
type Triangle = [u16; 3];

/// A pattern of solid corners, one of each class, and its triangles.
#[rustfmt::skip]
const SHAPES: [(usize, &[Triangle]); 20] = [
    (0b0000_0001, &[[0o001, 0o010, 0o100]]),
    (0b0000_0011, &[[0o012, 0o100, 0o102], [0o010, 0o012, 0o100]]),
    (0b0000_0110, &[
        [0o001, 0o102, 0o120], [0o001, 0o010, 0o120], [0o012, 0o102, 0o120], [0o012, 0o021, 0o120],
    ]),
    (0b0000_0111, &[[0o012, 0o102, 0o120], [0o100, 0o102, 0o120], [0o012, 0o021, 0o120]]),
    (0b0000_1111, &[[0o100, 0o102, 0o122], [0o100, 0o120, 0o122]]),
    (0b0001_0110, &[
        [0o100, 0o102, 0o201], [0o001, 0o100, 0o102], [0o100, 0o120, 0o210], [0o100, 0o201, 0o210],
        [0o001, 0o010, 0o012], [0o001, 0o012, 0o102], [0o010, 0o100, 0o120], [0o010, 0o021, 0o120],
        [0o010, 0o012, 0o021],
    ]),
    (0b0001_0111, &[
        [0o102, 0o120, 0o201], [0o120, 0o201, 0o210], [0o021, 0o102, 0o120], [0o012, 0o021, 0o102],
    ]),
    (0b0001_1000, &[[0o012, 0o021, 0o122], [0o100, 0o201, 0o210]]),
    (0b0001_1001, &[
        [0o122, 0o201, 0o210], [0o001, 0o012, 0o201], [0o012, 0o122, 0o201], [0o010, 0o021, 0o210],
        [0o021, 0o122, 0o210],
    ]),
    (0b0001_1011, &[
        [0o021, 0o102, 0o122], [0o021, 0o102, 0o210], [0o010, 0o021, 0o210], [0o102, 0o201, 0o210],
    ]),
    (0b0001_1110, &[
        [0o001, 0o010, 0o100], [0o102, 0o120, 0o122], [0o120, 0o201, 0o210], [0o102, 0o120, 0o201],
    ]),
    (0b0001_1111, &[[0o120, 0o201, 0o210], [0o102, 0o120, 0o201], [0o102, 0o120, 0o122]]),
    (0b0011_1100, &[
        [0o122, 0o210, 0o212], [0o120, 0o122, 0o210], [0o010, 0o012, 0o100], [0o012, 0o100, 0o102],
    ]),
    (0b0011_1101, &[
        [0o001, 0o120, 0o210], [0o102, 0o111, 0o210], [0o012, 0o102, 0o111], [0o111, 0o120, 0o122],
        [0o111, 0o210, 0o212], [0o111, 0o122, 0o212], [0o001, 0o102, 0o210], [0o012, 0o111, 0o120],
        [0o001, 0o012, 0o120],
    ]),
    (0b0011_1111, &[[0o120, 0o210, 0o212], [0o120, 0o122, 0o212]]),
    (0b0110_1001, &[
        [0o100, 0o201, 0o210], [0o010, 0o021, 0o120], [0o001, 0o012, 0o102], [0o122, 0o212, 0o221],
    ]),
    (0b0110_1011, &[[0o010, 0o021, 0o120], [0o100, 0o201, 0o210], [0o122, 0o212, 0o221]]),
    (0b0110_1111, &[[0o122, 0o212, 0o221], [0o100, 0o201, 0o210]]),
    (0b0111_1110, &[[0o001, 0o010, 0o100], [0o122, 0o212, 0o221]]),
    (0b0111_1111, &[[0o122, 0o212, 0o221]]),
];

/// Area of the surface in a cube for each pattern of solid corners, numbered as
/// [`configurations`](super::configurations::configurations) numbers them.
pub fn areas(voxel_size: [f64; 3]) -> [f64; PATTERNS] {
    let mut areas = [0.0; PATTERNS];
    for (pattern, triangles) in SHAPES {
        for symmetry in symmetries() {
            let corners = (0..8).filter(|bit| pattern >> bit & 1 == 1);
            let turned = corners.fold(0, |bits, bit| {
                let [z, y, x] = symmetry.apply([bit >> 2 & 1, bit >> 1 & 1, bit & 1], 1);
                bits | 1 << (4 * z + 2 * y + x)
            });
            let triangles = triangles.iter().map(|triangle| {
                let corners = triangle.map(|digits| {
                    let digits = usize::from(digits);
                    let corner = symmetry.apply([digits >> 6, digits >> 3 & 7, digits & 7], 2);
                    [0, 1, 2].map(|a| corner[a] as f64 * voxel_size[a] / 2.0)
                });
                triangle_area(corners)
            });
            areas[turned] = triangles.sum();
        }
    }
    areas
}

/// A symmetry of the cube.
struct Symmetry {
    /// Which axis comes in the place of each.
    axes: [usize; 3],
    /// Bit i mirrors axis i.
    mirrored: usize,
}

impl Symmetry {
    /// Moves a point of a cube with edges of length `edge`.
    fn apply(&self, point: [usize; 3], edge: usize) -> [usize; 3] {
        [0, 1, 2].map(|axis| {
            let coordinate = point[self.axes[axis]];
            if self.mirrored >> axis & 1 == 1 { edge - coordinate } else { coordinate }
        })
    }
}

fn symmetries() -> impl Iterator<Item = Symmetry> {
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    orders.into_iter().flat_map(|axes| (0..8).map(move |mirrored| Symmetry { axes, mirrored }))
}

fn triangle_area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let [u, v] = [b, c].map(|corner| [0, 1, 2].map(|i| corner[i] - a[i]));
    let normal = [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        u[j] * v[k] - u[k] * v[j]
    });
    normal.iter().map(|n| n * n).sum::<f64>().sqrt() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pattern_but_two_has_a_surface() {
        let areas = areas([1.0; 3]);
        for (pattern, &area) in areas.iter().enumerate() {
            assert_eq!(area > 0.0, pattern != 0 && pattern != PATTERNS - 1, "{pattern:08b}");
        }
    }

    #[test]
    fn known_areas() {
        let areas = areas([1.0, 2.0, 4.0]);
        assert!((areas[0b1111] - 8.0).abs() < 1e-12); // solid below: a face across z
        assert!((areas[0b0101_0101] - 2.0).abs() < 1e-12);
        let corner = (4.0 + 16.0 + 64.0f64).sqrt() / 8.0; // half edges ½, 1, 2
        assert!((areas[1] - corner).abs() < 1e-12);
        assert!((areas[254] - corner).abs() < 1e-12);
    }

    #[test]
    fn a_shape_fits_its_neighbours() {
        // The outline of the surface on a face of the cube depends on that face's voxels alone.
        let outline = |pattern: usize| -> Vec<[[usize; 3]; 2]> {
            let (shape, symmetry) = SHAPES
                .iter()
                .flat_map(|shape| symmetries().map(move |symmetry| (shape, symmetry)))
                .find(|((solid, _), symmetry)| {
                    let corners = (0..8).filter(|bit| solid >> bit & 1 == 1);
                    pattern
                        == corners.fold(0, |bits, bit| {
                            let [z, y, x] =
                                symmetry.apply([bit >> 2 & 1, bit >> 1 & 1, bit & 1], 1);
                            bits | 1 << (4 * z + 2 * y + x)
                        })
                })
                .unwrap();
            let mut edges = Vec::new();
            for triangle in shape.1 {
                let corners = triangle.map(|digits| {
                    let digits = usize::from(digits);
                    symmetry.apply([digits >> 6, digits >> 3 & 7, digits & 7], 2)
                });
                for i in 0..3 {
                    let mut edge = [corners[i], corners[(i + 1) % 3]];
                    edge.sort_unstable();
                    if (0..3).any(|a| edge[0][a] == edge[1][a] && edge[0][a] != 1) {
                        edges.push(edge);
                    }
                }
            }
            edges.sort_unstable();
            // An edge between two triangles of one cube is no outline.
            let alone = |edge: &[[usize; 3]; 2]| edges.iter().filter(|&e| e == edge).count() == 1;
            edges.iter().filter(|edge| alone(edge)).copied().collect()
        };
        for below in 1..255usize {
            for top in 0..16 {
                // A cube on top of this one whose lower corners are this one's upper ones.
                let above = below >> 4 | top << 4;
                if above == 0 || above == 255 {
                    continue;
                }
                let on = |pattern, z| -> Vec<[[usize; 2]; 2]> {
                    let edges = outline(pattern).into_iter();
                    edges
                        .filter(|edge| edge.iter().all(|corner| corner[0] == z))
                        .map(|edge| edge.map(|corner| [corner[1], corner[2]]))
                        .collect()
                };
                assert_eq!(on(below, 2), on(above, 0), "{below:08b} under {above:08b}");
            }
        }
    }
}
