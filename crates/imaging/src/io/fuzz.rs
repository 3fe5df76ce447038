//! Damaged files of every format: an error or a sound image, never a panic, never memory for what the file only claims.

use proptest::prelude::*;
use tiff::encoder::{Compression, compression::DeflateLevel};

use super::tests::{COLOUR, GREY, compressed_tiff, file, palette_png, planar_tiff};
use super::{Depth, Format, encode, parse_image};

fn samples() -> Vec<Vec<u8>> {
    let written = |channels, alpha, depth, format| {
        let mut file = file(channels, alpha, depth);
        file.icc = Some(b"a profile".to_vec());
        encode(&file, format).unwrap().bytes
    };
    vec![
        written(1, false, Depth::U8, Format::Png),
        written(3, true, Depth::U16, Format::Png),
        palette_png(),
        written(1, false, Depth::F32, Format::Tiff),
        written(3, true, Depth::U16, Format::Tiff),
        written(2, false, Depth::F64, Format::Tiff),
        planar_tiff(),
        compressed_tiff(Compression::Lzw),
        compressed_tiff(Compression::Packbits),
        compressed_tiff(Compression::Deflate(DeflateLevel::Fast)),
        GREY.to_vec(),
        COLOUR.to_vec(),
        written(3, false, Depth::F64, Format::Npy),
        b"# a kernel\n0 .25, 0\n.5;1e0 2\n".to_vec(),
    ]
}

/// Read, and written again where it can be read.
fn parse(data: &[u8]) -> Result<(), String> {
    match parse_image("fuzz", data) {
        Ok(file) => {
            assert!(file.image.channels.iter().chain(file.alpha.as_ref()).all(|p| p.len() == file.image.n_pixels()));
            for format in [Format::Png, Format::Tiff, Format::Npy] {
                let _ = encode(&file, format);
            }
            Ok(())
        }
        Err(e) if e.0.lines().count() == 1 && e.0.starts_with("fuzz: ") => Ok(()),
        Err(e) => Err(e.0),
    }
}

#[test]
fn every_prefix_is_refused_or_sound() {
    for (k, data) in samples().iter().enumerate() {
        assert!(parse_image("whole", data).is_ok(), "{k}");
        for n in 0..data.len() {
            parse(&data[..n]).unwrap_or_else(|e| panic!("{k} cut at {n}: {e}"));
        }
    }
}

/// One place in a file and what happens there.
#[derive(Clone, Debug)]
enum Damage {
    Set(u8),
    Flip(u8),
    Delete(usize),
    Insert(Vec<u8>),
    Repeat(usize),
}

fn damage() -> impl Strategy<Value = (usize, Damage)> {
    let words =
        prop::sample::select(vec!["-1", "99999999999999999999", "1e999", "nan", "\n", "\0\0\0\0", "(", "'", "x"]);
    let kind = prop_oneof![
        any::<u8>().prop_map(Damage::Set),
        (0..8u8).prop_map(Damage::Flip),
        (1..40usize).prop_map(Damage::Delete),
        prop::collection::vec(any::<u8>(), 1..9).prop_map(Damage::Insert),
        words.prop_map(|w| Damage::Insert(w.as_bytes().to_vec())),
        (1..60usize).prop_map(Damage::Repeat),
    ];
    (any::<usize>(), kind)
}

fn apply(data: &mut Vec<u8>, (place, damage): &(usize, Damage)) {
    if data.is_empty() {
        return;
    }
    let at = place % data.len();
    match damage {
        Damage::Set(b) => data[at] = *b,
        Damage::Flip(bit) => data[at] ^= 1 << bit,
        Damage::Delete(n) => drop(data.drain(at..(at + n).min(data.len()))),
        Damage::Insert(bytes) => drop(data.splice(at..at, bytes.iter().copied())),
        Damage::Repeat(n) => {
            let part = data[at..(at + n).min(data.len())].to_vec();
            drop(data.splice(at..at, part));
        }
    }
}

/// PNG's checksums made right again, so that damage reaches what lies behind them.
fn mend_sums(data: &mut [u8]) {
    let mut at = 8;
    while let Some(length) = data.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_be_bytes) {
        let end = (at + 8).saturating_add(length as usize);
        let Some(chunk) = data.get(at + 4..end) else { return };
        let sum = super::tests::crc(chunk).to_be_bytes();
        let Some(place) = data.get_mut(end..end + 4) else { return };
        place.copy_from_slice(&sum);
        at = end + 4;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files(which in 0..14usize, damages in prop::collection::vec(damage(), 1..6)) {
        let mut data = samples().swap_remove(which);
        damages.iter().for_each(|d| apply(&mut data, d));
        prop_assert_eq!(parse(&data), Ok(()));
        if data.starts_with(super::png::MAGIC) {
            mend_sums(&mut data);
            prop_assert_eq!(parse(&data), Ok(()));
        }
    }

    #[test]
    fn noise(which in 0..14usize, keep in 0..12usize, tail in prop::collection::vec(any::<u8>(), 0..300)) {
        let mut data = samples().swap_remove(which);
        data.truncate(keep);
        data.extend(tail);
        prop_assert_eq!(parse(&data), Ok(()));
    }
}
