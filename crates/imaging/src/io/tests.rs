//! Round trips, what is carried and what is told, and what is refused.

use super::*;

pub(super) const GREY: &[u8] = include_bytes!("../../testdata/grey.jpg");
pub(super) const COLOUR: &[u8] = include_bytes!("../../testdata/colour.jpg");
const CMYK: &[u8] = include_bytes!("../../testdata/cmyk.jpg");

/// An EXIF block: little-endian, one tag, the orientation 6.
const EXIF: &[u8] = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0";

/// Values that integers of `most` hold exactly.
fn image(width: usize, height: usize, channels: usize, most: u32) -> Image {
    let value = |c: usize, k: usize| {
        let v = (k as u64 * 2_654_435_761 + c as u64 * 40_503) % (u64::from(most) + 1);
        v as f64 / f64::from(most)
    };
    let planes = (0..channels).map(|c| (0..width * height).map(|k| value(c, k)).collect()).collect();
    Image::new(width, height, planes).unwrap()
}

pub(super) fn file(channels: usize, alpha: bool, depth: Depth) -> ImageFile {
    let most = match depth {
        Depth::U8 => 255,
        Depth::U16 => 65535,
        _ => u32::MAX,
    };
    let mut image = image(7, 5, channels, most);
    if depth == Depth::F32 {
        image.channels.iter_mut().flatten().for_each(|v| *v = f64::from((3.0 * *v - 1.0) as f32));
    }
    let alpha = alpha.then(|| (0..35).map(|k| f64::from(k % 2)).collect());
    ImageFile { alpha, ..ImageFile::new(image, depth) }
}

fn again(file: &ImageFile, format: Format) -> ImageFile {
    parse_image("again", &encode(file, format).unwrap().bytes).unwrap()
}

fn wrong(data: &[u8]) -> String {
    parse_image("name.ext", data).expect_err("refused").0
}

#[test]
fn what_a_format_holds_comes_back_to_the_bit() {
    for depth in [Depth::U8, Depth::U16, Depth::U32, Depth::F32, Depth::F64] {
        for (channels, alpha) in [(1, false), (1, true), (3, false), (3, true), (2, false), (5, true)] {
            let mut file = file(channels, alpha, depth);
            file.icc = Some(b"a profile of odd length".to_vec());
            assert_eq!(again(&file, Format::Tiff), file, "TIFF {depth:?} {channels} {alpha}");
            if matches!(depth, Depth::U8 | Depth::U16) && matches!(channels, 1 | 3) {
                file.exif = Some(EXIF.to_vec());
                assert_eq!(again(&file, Format::Png), file, "PNG {depth:?} {channels} {alpha}");
            }
            let npy = again(&file, Format::Npy);
            assert_eq!((npy.image, npy.depth), (file.image, Depth::F64));
        }
    }
}

#[test]
fn what_is_lost_is_told() {
    let mut file = file(3, true, Depth::F32);
    file.exif = Some(EXIF.to_vec());
    file.icc = Some(vec![1, 2, 3]);
    let outside = file.image.channels.iter().flatten().filter(|v| **v < 0.0 || **v > 1.0).count();
    let png = encode(&file, Format::Png).unwrap();
    assert_eq!(png.lost.len(), 2);
    assert!(outside > 0 && png.lost[0].starts_with(&format!("{outside} of 105 values")), "{:?}", png.lost);
    assert!(png.lost[1].contains("16 bits"));
    let npy = encode(&file, Format::Npy).unwrap();
    assert!(npy.lost.iter().zip(["alpha", "EXIF", "the ICC"]).all(|(told, what)| told.starts_with(what)));
    assert_eq!(npy.lost.len(), 3);
    let smaller = file.clone().with_image(image(2, 2, 1, 255));
    assert!(smaller.alpha.is_none() && smaller.icc.is_none() && smaller.notes.len() == 2);
    assert_eq!(file.clone().with_image(file.image.clone()), file);
}

#[test]
fn images_that_a_format_cannot_hold_are_refused() {
    assert!(encode(&file(2, false, Depth::U8), Format::Png).unwrap_err().0.contains("1 or 3 channels"));
    let mut large = file(1, false, Depth::F32);
    large.image.channels[0][3] = 1e39;
    assert!(encode(&large, Format::Tiff).unwrap_err().0.contains("beyond single precision"));
    large.image.channels[0][3] = f64::NAN;
    for format in [Format::Png, Format::Tiff, Format::Npy] {
        assert!(encode(&large, format).unwrap_err().0.contains("not finite"));
    }
    large.image.channels[0].pop();
    assert!(encode(&large, Format::Npy).is_err());
}

#[test]
fn jpeg_with_exif_and_profile() {
    let grey = parse_image("grey", GREY).unwrap();
    assert_eq!((grey.image.width, grey.image.height, grey.image.channels.len()), (11, 9, 1));
    // Of the file as another decoder has it, to a step of 8 bits; the ramp that was stored is 12 (row + column).
    for (k, want) in [(0, 0.0), (1, 12.0), (11, 12.0), (12, 24.0), (23, 37.0)] {
        assert!((grey.image.channels[0][k] * 255.0 - want).abs() <= 1.01, "{k}");
    }
    let colour = parse_image("colour", COLOUR).unwrap();
    for (plane, want) in colour.image.channels.iter().zip([2.0, 253.0, 78.0]) {
        assert!((plane[0] * 255.0 - want).abs() <= 2.01);
    }
    assert_eq!(colour.icc.as_deref(), Some(b"profile of nothing".as_slice()));
    assert!(colour.exif.as_deref().is_some_and(|e| e.starts_with(b"II") || e.starts_with(b"MM")));
    let png = again(&colour, Format::Png);
    assert_eq!((&png.image, &png.exif, &png.icc), (&colour.image, &colour.exif, &colour.icc));
    // To TIFF and back the block is laid out anew, and says the same.
    let tiff = again(&colour, Format::Tiff);
    let said = |file: &ImageFile| exif::parse(file.exif.as_deref().unwrap()).map(exif::kept).unwrap();
    assert_eq!((said(&tiff), &tiff.icc), (said(&colour), &colour.icc));
    assert!(said(&tiff).iter().any(|e| e.tag == 0x112), "the orientation");
    assert!(wrong(CMYK).contains("convert it to RGB"));
    assert!(wrong(&COLOUR[..COLOUR.len() / 2]).contains("truncated"));
}

/// A PNG by the crate's own encoder, of kinds that we do not write.
fn png_of(color: ::png::ColorType, depth: ::png::BitDepth, data: &[u8], palette: Option<(&[u8], &[u8])>) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut out, 4, 2);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if let Some((colours, alpha)) = palette {
        encoder.set_palette(colours.to_vec());
        encoder.set_trns(alpha.to_vec());
    }
    encoder.set_source_gamma(::png::ScaledFloat::new(0.5));
    encoder.set_pixel_dims(Some(::png::PixelDimensions { xppu: 100, yppu: 200, unit: ::png::Unit::Meter }));
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    out
}

pub(super) fn palette_png() -> Vec<u8> {
    let colours = [0, 0, 0, 255, 0, 51, 0, 102, 255];
    png_of(::png::ColorType::Indexed, ::png::BitDepth::Two, &[0b0001_1000, 0b1001_0000], Some((&colours, &[255, 51])))
}

#[test]
fn palettes_and_few_bits() {
    let file = parse_image("palette", &palette_png()).unwrap();
    let [red, green, blue] = file.image.channels.as_slice() else { panic!("three channels") };
    assert_eq!(red, &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    assert_eq!(green, &[0.0, 0.0, 0.4, 0.0, 0.4, 0.0, 0.0, 0.0]);
    assert_eq!(blue, &[0.0, 0.2, 1.0, 0.0, 1.0, 0.2, 0.0, 0.0]);
    assert_eq!(file.alpha.as_deref(), Some([1.0, 0.2, 1.0, 1.0, 1.0, 0.2, 1.0, 1.0].as_slice()));
    assert!(file.notes[0].contains("palette"));
    assert_eq!(again(&file, Format::Png).png_display, file.png_display);
    assert!(encode(&file, Format::Tiff).unwrap().lost[0].contains("gamma"));
    let packed = png_of(::png::ColorType::Grayscale, ::png::BitDepth::Two, &[0b0001_1011, 0b1101_1000], None);
    let file = parse_image("packed", &packed).unwrap();
    let want = [0, 1, 2, 3, 3, 1, 2, 0].map(|v| f64::from(v * 85) / 255.0);
    assert_eq!(file.image.channels, vec![want.to_vec()]);
    assert!(file.notes[0].contains("written as 8"));
}

/// A big-endian TIFF with planes apart, whose alpha is associated, as other programs write it.
pub(super) fn planar_tiff() -> Vec<u8> {
    let mut out = b"MM\0*".to_vec();
    let pixels: [[u8; 2]; 4] = [[10, 20], [0, 40], [60, 80], [128, 0]];
    let mut tags: Vec<(u16, u16, Vec<u8>)> = Vec::new();
    let shorts = |v: &[u16]| v.iter().flat_map(|v| v.to_be_bytes()).collect::<Vec<u8>>();
    let longs = |v: &[u32]| v.iter().flat_map(|v| v.to_be_bytes()).collect::<Vec<u8>>();
    tags.push((256, 3, shorts(&[2])));
    tags.push((257, 3, shorts(&[1])));
    tags.push((258, 3, shorts(&[8; 4])));
    tags.push((259, 3, shorts(&[1])));
    tags.push((262, 3, shorts(&[2])));
    tags.push((273, 4, longs(&[8, 10, 12, 14])));
    tags.push((277, 3, shorts(&[4])));
    tags.push((279, 4, longs(&[2; 4])));
    tags.push((284, 3, shorts(&[2])));
    tags.push((338, 3, shorts(&[1])));
    let mut body = pixels.concat();
    let mut entries = Vec::new();
    for (tag, kind, value) in &tags {
        let count = value.len() as u32 / if *kind == 3 { 2 } else { 4 };
        let mut held = [0; 4];
        if value.len() <= 4 {
            held[..value.len()].copy_from_slice(value);
        } else {
            held = (8 + body.len() as u32).to_be_bytes();
            body.extend(value);
        }
        entries.extend(tag.to_be_bytes());
        entries.extend(kind.to_be_bytes());
        entries.extend(count.to_be_bytes());
        entries.extend(held);
    }
    out.extend((8 + body.len() as u32).to_be_bytes());
    out.extend(body);
    out.extend((tags.len() as u16).to_be_bytes());
    out.extend(entries);
    out.extend([0; 4]);
    out
}

/// By the crate's own encoder, compressed.
pub(super) fn compressed_tiff(compression: ::tiff::encoder::Compression) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let mut encoder = ::tiff::encoder::TiffEncoder::new(&mut out).unwrap().with_compression(compression);
    let data: Vec<u16> = (0..40 * 30).map(|k| (k * 53) as u16).collect();
    encoder.write_image::<::tiff::encoder::colortype::Gray16>(40, 30, &data).unwrap();
    out.into_inner()
}

#[test]
fn tiff_as_others_write_it() {
    let file = parse_image("planar", &planar_tiff()).unwrap();
    let alpha = [128.0 / 255.0, 0.0];
    assert_eq!(file.alpha.as_deref(), Some(alpha.as_slice()));
    for (plane, v) in file.image.channels.iter().zip([10.0, 0.0, 60.0]) {
        assert!((plane[0] - v / 128.0).abs() < 1e-15 && plane[1] == 0.0, "{plane:?}");
    }
    assert!(file.notes[0].contains("divided"));
    use ::tiff::encoder::{Compression, compression::DeflateLevel};
    for c in [Compression::Lzw, Compression::Packbits, Compression::Deflate(DeflateLevel::Balanced)] {
        let file = parse_image("compressed", &compressed_tiff(c)).unwrap();
        assert!((0..1200).all(|k| file.image.channels[0][k] == f64::from((k * 53) as u16) / 65535.0));
    }
}

#[test]
fn arrays() {
    let psf = parse_image("psf.txt", b"# a kernel\n0 .25, 0\n\n.5;1e0 2 # with a comment\n").unwrap();
    assert_eq!((psf.image.width, psf.image.height), (3, 2));
    assert_eq!(psf.image.channels, vec![vec![0.0, 0.25, 0.0, 0.5, 1.0, 2.0]]);
    assert!(wrong(b"1 2\n3 x\n").contains("line 2: `x` is no number"));
    assert!(wrong(b"1 2\n3\n").contains("line 2 has 1 numbers, those before it 2"));
    assert!(wrong(b"1 inf\n").contains("row 0, column 1"));
    assert!(wrong(b"hello").contains("no image"));
    assert!(wrong(b"").contains("empty"));
    let npy = |descr: &str, fortran: &str, shape: &str, body: &[u8]| {
        let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\0".as_slice(), &length, header.as_bytes(), body].concat()
    };
    let body: Vec<u8> = (0..12u16).flat_map(|v| (v * 5000).to_be_bytes()).collect();
    let file = parse_image("a.npy", &npy(">u2", "True", "(2, 3, 2)", &body)).unwrap();
    // Element (i, j, c) of an array in Fortran order stands at i + 2 j + 6 c.
    let want = |c: usize| (0..6).map(|k| ((k / 3 + 2 * (k % 3) + 6 * c) * 5000) as f64 / 65535.0).collect::<Vec<_>>();
    assert_eq!(file.image.channels, vec![want(0), want(1)]);
    assert!(wrong(&npy("<i8", "False", "(1, 1)", &[0; 8])).contains("type <i8"));
    assert!(wrong(&npy("<f8", "False", "(4,)", &[0; 32])).contains("shape is [4]"));
    assert!(wrong(&npy("<f8", "False", "(2, 2)", &[0; 31])).contains("truncated"));
    assert!(wrong(&npy("<f8", "False", "(4000000000, 4000000000)", &[])).contains("samples"));
    let nan = [f64::NAN.to_le_bytes(), 0f64.to_le_bytes()].concat();
    assert!(wrong(&npy("<f8", "False", "(1, 2)", &nan)).contains("row 0, column 0: the value is NaN"));
}

/// The checksum of PNG's chunks, bit by bit.
pub(super) fn crc(data: &[u8]) -> u32 {
    let step = |c: u32| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
    !data.iter().fold(!0u32, |c, b| (0..8).fold(c ^ u32::from(*b), |c, _| step(c)))
}

#[test]
fn claims_are_refused_before_memory_is_taken() {
    let mut huge = encode(&file(1, false, Depth::U8), Format::Png).unwrap().bytes;
    for claim in [u32::MAX >> 1, 20_000] {
        huge[16..20].copy_from_slice(&claim.to_be_bytes());
        huge[20..24].copy_from_slice(&claim.to_be_bytes());
        let sum = crc(&huge[12..29]);
        huge[29..33].copy_from_slice(&sum.to_be_bytes());
        assert!(wrong(&huge).contains(&format!("claims {claim} x {claim} pixels")), "{}", wrong(&huge));
    }
    let mut huge = encode(&file(1, false, Depth::U8), Format::Tiff).unwrap().bytes;
    for id in [256u16, 257, 278] {
        let entry = [id.to_le_bytes().as_slice(), &[4, 0, 1, 0, 0, 0]].concat(); // one LONG
        let at = huge.windows(8).rposition(|w| w == entry).unwrap();
        huge[at + 8..at + 12].copy_from_slice(&40_000u32.to_le_bytes());
    }
    assert!(wrong(&huge).contains("claims 40000 x 40000"), "{}", wrong(&huge));
    let mut huge = GREY.to_vec();
    let at = huge.windows(2).position(|w| w == b"\xff\xc0").unwrap();
    huge[at + 5..at + 9].copy_from_slice(&[0xff; 4]);
    assert!(wrong(&huge).contains("claims 65535 x 65535"), "{}", wrong(&huge));
}

#[test]
fn kinds_that_are_not_read_are_named() {
    assert!(wrong(b"RIFF\x10\0\0\0WEBPVP8 ").contains("WebP"));
    assert!(wrong(b"FUJIFILMCCD-RAW 0201").contains("RAW"));
    assert!(wrong(b"II*\0\x10\0\0\0CR\x02\0").contains("RAW"));
    let tiff = encode(&file(1, false, Depth::U8), Format::Tiff).unwrap().bytes;
    assert!(parse_image("photo.NEF", &tiff).unwrap_err().0.contains("develop it"));
    assert!(wrong(b"\x89PNG\r\n\x1a\n").starts_with("name.ext: it is a damaged"));
    assert!(read_image(Path::new("/no/such/file.png")).unwrap_err().0.contains("cannot read"));
    assert!(Format::from_path(Path::new("a.jpg")).unwrap_err().0.contains("not written"));
    assert_eq!(Format::from_path(Path::new("a.TIFF")), Ok(Format::Tiff));
}
