//! The median of values that come and go: of a window that moves over an image.

/// Words of bits that are counted together.
const WORDS: usize = 16;

/// Which of some values, put into order once, are in the window: a bit each.
pub(crate) struct MovingMedian {
    bits: Vec<[u64; WORDS]>,
    /// Values of the window in each of these.
    counts: Vec<usize>,
    count: usize,
    /// Where the last median was, and how many values of the window are below all of it.
    block: usize,
    below: usize,
}

impl MovingMedian {
    /// Of an empty window, for a number of values in all.
    pub(crate) fn new(values: usize) -> Self {
        let blocks = values.div_ceil(64 * WORDS);
        Self {
            bits: vec![[0; WORDS]; blocks],
            counts: vec![0; blocks],
            count: 0,
            block: 0,
            below: 0,
        }
    }

    /// The value of this rank, which is not in the window yet, comes.
    pub(crate) fn add(&mut self, rank: u32) {
        let (block, word) = at(rank);
        self.bits[block][word] |= 1 << (rank % 64);
        self.counts[block] += 1;
        self.count += 1;
        self.below += usize::from(block < self.block);
    }

    /// The value of this rank, which is in the window, goes.
    pub(crate) fn remove(&mut self, rank: u32) {
        let (block, word) = at(rank);
        self.bits[block][word] &= !(1 << (rank % 64));
        self.counts[block] -= 1;
        self.count -= 1;
        self.below -= usize::from(block < self.block);
    }

    /// The rank of the middle one (the upper of two); `None` of none.
    pub(crate) fn median(&mut self) -> Option<usize> {
        if self.count == 0 {
            return None;
        }
        let half = self.count / 2;
        while self.below > half {
            self.block -= 1;
            self.below -= self.counts[self.block];
        }
        while self.below + self.counts[self.block] <= half {
            self.below += self.counts[self.block];
            self.block += 1;
        }
        let mut wanted = half - self.below;
        for (word, bits) in self.bits[self.block].iter().enumerate() {
            let here = bits.count_ones() as usize;
            if wanted < here {
                let bits = (0..wanted).fold(*bits, |bits, _| bits & (bits - 1));
                return Some(64 * (WORDS * self.block + word) + bits.trailing_zeros() as usize);
            }
            wanted -= here;
        }
        None
    }
}

/// The block and the word in it of a rank.
fn at(rank: u32) -> (usize, usize) {
    let word = rank as usize / 64;
    (word / WORDS, word % WORDS)
}
