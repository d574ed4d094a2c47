//! A queue for costs that never fall below the last one taken (a radix heap): several times as fast as
//! a binary heap, for its entries move through short lists instead of across the memory.

/// Places in the order of their costs. Floats that are not negative have the order of their bits.
pub(super) struct Queue {
    /// List 0: those of the last cost. List i: those whose highest bit that differs from it is i − 1.
    lists: [Vec<(u32, usize)>; 33],
    last: u32,
}

impl Default for Queue {
    fn default() -> Self {
        Self { lists: std::array::from_fn(|_| Vec::new()), last: 0 }
    }
}

impl Queue {
    pub(super) fn clear(&mut self) {
        self.lists.iter_mut().for_each(Vec::clear);
        self.last = 0;
    }

    /// Takes in a place, at no less than the last cost, which must not be negative.
    #[inline(always)]
    pub(super) fn push(&mut self, cost: f32, at: usize) {
        self.enter(cost.to_bits(), at);
    }

    /// Gives out a place of the lowest cost. Those of equal costs come in an order that depends on
    /// nothing but what was pushed before.
    pub(super) fn pop(&mut self) -> Option<(f32, usize)> {
        if self.lists[0].is_empty() {
            self.deal();
        }
        self.lists[0].pop().map(|(bits, at)| (f32::from_bits(bits), at))
    }

    #[inline(always)]
    fn enter(&mut self, bits: u32, at: usize) {
        let list = u32::BITS - (bits ^ self.last).leading_zeros();
        self.lists[list as usize].push((bits, at));
    }

    /// Deals the first list that has entries to the lists before it.
    fn deal(&mut self) {
        let Some(first) = self.lists.iter().position(|list| !list.is_empty()) else { return };
        let mut entries = std::mem::take(&mut self.lists[first]);
        self.last = entries.iter().fold(u32::MAX, |least, &(bits, _)| least.min(bits));
        for (bits, at) in entries.drain(..) {
            self.enter(bits, at);
        }
        // Its memory serves again.
        self.lists[first] = entries;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Key;

    #[test]
    fn costs_come_out_in_order() {
        let mut queue = Queue::default();
        for seed in 0..20 {
            let key = Key::new(seed);
            let mut left = Vec::new();
            let mut last = 0.0;
            for i in 0..2000 {
                if key.unit(3 * i) < 0.6 {
                    // Coarse, so that many are equal.
                    let cost = last + (8.0 * key.unit(3 * i + 1)).floor() / 4.0;
                    queue.push(cost, i as usize);
                    left.push((cost, i as usize));
                } else if let Some(found) = queue.pop() {
                    assert!(left.iter().all(|other| found.0 <= other.0));
                    left.retain(|&other| other != found);
                    last = found.0;
                } else {
                    assert!(left.is_empty());
                }
            }
            queue.clear();
            assert_eq!(queue.pop(), None);
        }
    }
}
