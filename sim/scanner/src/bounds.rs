//! Axis-aligned bounding boxes and a bounding volume hierarchy (BVH) over them.

use crate::ray::Ray;
use platen_sim_plate::Vec3;

/// Axis-aligned bounding box, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    min: Vec3,
    max: Vec3,
}

impl Bounds {
    /// Returns the smallest box that contains all points, grown by `margin` on every side.
    pub(crate) fn of(points: impl IntoIterator<Item = Vec3>, margin: f64) -> Self {
        let mut bounds = Self { min: Vec3::repeat(f64::INFINITY), max: Vec3::repeat(f64::NEG_INFINITY) };
        for point in points {
            bounds.min = bounds.min.inf(&point);
            bounds.max = bounds.max.sup(&point);
        }
        Self { min: bounds.min.add_scalar(-margin), max: bounds.max.add_scalar(margin) }
    }

    fn union(&self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    fn centre(&self) -> Vec3 {
        (self.min + self.max) / 2.0
    }

    /// Returns the range at which a ray enters (0 when it starts inside); `None` when it misses or enters beyond
    /// `limit` (slab method).
    fn entry(&self, ray: &Ray, inverse: &Vec3, limit: f64) -> Option<f64> {
        let (mut near, mut far) = (0.0_f64, limit);
        for k in 0..3 {
            let (a, b) =
                ((self.min[k] - ray.origin[k]) * inverse[k], (self.max[k] - ray.origin[k]) * inverse[k]);
            // min and max ignore the NaN of a ray that lies in a face.
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near <= far).then_some(near)
    }
}

#[derive(Debug, Clone)]
enum Node {
    Leaf {
        first: u32,
        end: u32,
    },
    /// The left child follows its parent.
    Inner {
        right: u32,
    },
}

/// Largest number of items in a leaf.
const LEAF: usize = 2;

/// Upper bound of the depth of a tree over u32 items: every inner node halves its items.
const STACK: usize = 64;

/// Bounding volume hierarchy, split at the median of the longest axis.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tree {
    nodes: Vec<(Bounds, Node)>,
    items: Vec<u32>,
}

impl Tree {
    /// Builds a tree over `bounds`; items are identified by their index.
    pub(crate) fn new(bounds: &[Bounds]) -> Self {
        let mut tree = Self { nodes: Vec::new(), items: (0..bounds.len() as u32).collect() };
        if !bounds.is_empty() {
            tree.build(bounds, 0, bounds.len());
        }
        tree
    }

    fn build(&mut self, bounds: &[Bounds], first: usize, end: usize) {
        let items = &mut self.items[first..end];
        let of = |item: &u32| bounds[*item as usize];
        let whole = items[1..].iter().fold(of(&items[0]), |sum, item| sum.union(&of(item)));
        if items.len() <= LEAF {
            self.nodes.push((whole, Node::Leaf { first: first as u32, end: end as u32 }));
            return;
        }
        let axis = (whole.max - whole.min).imax();
        let middle = items.len() / 2;
        items.select_nth_unstable_by(middle, |a, b| {
            of(a).centre()[axis].total_cmp(&of(b).centre()[axis]).then(a.cmp(b))
        });
        let here = self.nodes.len();
        self.nodes.push((whole, Node::Inner { right: 0 }));
        self.build(bounds, first, first + middle);
        self.nodes[here].1 = Node::Inner { right: self.nodes.len() as u32 };
        self.build(bounds, first + middle, end);
    }

    /// Calls `visit` for every item whose box the ray enters before `limit`, near boxes first. `visit` returns the
    /// range of the nearest hit so far, beyond which no further item is visited.
    pub(crate) fn visit(&self, ray: &Ray, mut limit: f64, mut visit: impl FnMut(u32, f64) -> f64) {
        let inverse = ray.direction.map(|c| 1.0 / c);
        let mut stack = [(0_u32, 0.0_f64); STACK];
        let mut height = 0;
        if let Some(near) = self.nodes.first().and_then(|(bounds, _)| bounds.entry(ray, &inverse, limit)) {
            stack[0] = (0, near);
            height = 1;
        }
        while height > 0 {
            height -= 1;
            let (index, near) = stack[height];
            if near > limit {
                continue;
            }
            match self.nodes[index as usize].1 {
                Node::Leaf { first, end } => {
                    for item in &self.items[first as usize..end as usize] {
                        limit = limit.min(visit(*item, limit));
                    }
                }
                Node::Inner { right } => {
                    let entry = |child: u32| self.nodes[child as usize].0.entry(ray, &inverse, limit);
                    let mut children = [(index + 1, entry(index + 1)), (right, entry(right))];
                    if children[0].1 < children[1].1 {
                        children.swap(0, 1);
                    }
                    // The nearer child is pushed last and therefore visited first.
                    for (child, near) in children.into_iter().filter_map(|(child, near)| Some((child, near?)))
                    {
                        stack[height] = (child, near);
                        height += 1;
                    }
                }
            }
        }
    }
}
