//! Pixels as nodes.

/// What lies beyond the border of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Boundary {
    /// The image again: differences and convolutions wrap around.
    #[default]
    Periodic,
    /// Its mirror image: differences across the border are 0.
    Neumann,
}

/// A field of pixels, each a node of one number a channel. Row by row from the top, in each row channel by channel: the node
/// of row i, channel c, column j is `(i * channels + c) * width + j`, so that a range of rows is a range of nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Numbers a pixel.
    pub channels: usize,
}

/// Numbers that one task handles, or [`TILE_ROWS`] rows if these have more.
const TASK: usize = 16384;

/// Rows of a field whose spectra are kept together.
pub(crate) const TILE_ROWS: usize = 8;

impl Grid {
    /// Of one channel.
    pub fn new(width: usize, height: usize) -> Self {
        Grid { width, height, channels: 1 }
    }

    /// Pixels.
    pub fn n_pixels(&self) -> usize {
        self.width * self.height
    }

    /// Nodes.
    pub fn len(&self) -> usize {
        self.n_pixels() * self.channels
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Nodes of a row.
    pub fn row_len(&self) -> usize {
        self.width * self.channels
    }

    /// Rows that one task handles, whole tiles of a spectrum or all there are: a matter of the image alone, never of the number
    /// of threads.
    pub fn task_rows(&self) -> usize {
        let rows = (TASK / self.row_len().max(1)).max(1);
        rows.next_multiple_of(TILE_ROWS).min(self.height.max(1))
    }
}
