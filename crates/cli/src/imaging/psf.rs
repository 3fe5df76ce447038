//! The point spread function, by name or file.

use std::path::Path;

use proxel::imaging::Psf;
use proxel::imaging::io::read_image;

use crate::refusal::Refusal;

/// gaussian:S, motion:LENGTH,ANGLE, disk:R, or a file.
pub fn parse(text: &str, center: Option<&str>) -> Result<Psf, Refusal> {
    let center = center.map(parse_center).transpose()?;
    let Some(psf) = Psf::named(text) else { return read(Path::new(text), center) };
    let psf = psf.map_err(|e| Refusal::new(format!("--psf {text}: {e}")))?;
    match center {
        Some(_) => Ok(Psf::new(psf.width, psf.height, psf.weights, center)?),
        None => Ok(psf),
    }
}

fn parse_center(text: &str) -> Result<(usize, usize), Refusal> {
    let parsed = text.split_once(',').and_then(|(i, j)| i.trim().parse().ok().zip(j.trim().parse().ok()));
    parsed.ok_or_else(|| Refusal::new(format!("--psf-center {text}: give a row and a column from 0, such as 7,7")))
}

fn read(path: &Path, center: Option<(usize, usize)>) -> Result<Psf, Refusal> {
    let file = read_image(path)?;
    let image = file.image;
    // A grey kernel is often kept as colours that are all the same.
    let Some((first, others)) = image.channels.split_first() else {
        return Err(Refusal::new(format!("{}: no channel", path.display())));
    };
    if others.iter().any(|other| other != first) {
        let text = format!("{}: a point spread function in colours; give one of grey", path.display());
        return Err(Refusal::new(text));
    }
    Psf::new(image.width, image.height, first.clone(), center)
        .map_err(|e| Refusal::new(format!("{}: {e}", path.display())))
}
