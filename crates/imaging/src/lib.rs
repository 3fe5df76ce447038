//! Images: what they are, the terms and global steps of their grids, and their formats.
//!
//! A pixel is a node with one number, so that an image problem is a [`proxel_split::Problem`] of `dim` 1.

mod image;
pub mod io;

pub use image::{Image, ImageError};
