//! The point spread function, by name or file.

use std::path::Path;

use proxel::imaging::Psf;
use proxel::imaging::io::read_image;

use crate::refusal::Refusal;

/// gaussian:S, motion:LENGTH,ANGLE, disk:R, or a file.
pub fn parse(text: &str, center: Option<&str>) -> Result<Psf, Refusal> {
    let center = center.map(parse_center).transpose()?;
    let named = text.split_once(':').filter(|(name, _)| ["gaussian", "motion", "disk"].contains(name));
    let Some((name, numbers)) = named else { return read(Path::new(text), center) };
    let parsed: Option<Vec<f64>> = numbers.split(',').map(|n| n.trim().parse().ok()).collect();
    let psf = match (name, parsed.as_deref()) {
        ("gaussian", Some([s])) => Psf::gaussian(*s)?,
        ("disk", Some([r])) => Psf::disk(*r)?,
        ("motion", Some([length, angle])) => Psf::motion(*length, *angle)?,
        _ => {
            let text = format!("--psf {text}: give gaussian:S, motion:LENGTH,ANGLE or disk:R, such as gaussian:1.6");
            return Err(Refusal::new(text));
        }
    };
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
