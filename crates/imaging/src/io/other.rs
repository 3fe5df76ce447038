//! Files that are not read, known by their first bytes or, where those are of TIFF, by name.

/// Extensions of cameras' files that begin as TIFF does.
const CAMERA: [&str; 10] = ["dng", "nef", "nrw", "cr2", "arw", "srf", "sr2", "pef", "3fr", "iiq"];

const RAW: &str = "a RAW file of a camera is not read, since its pixels need developing first; \
    develop it to a linear 16-bit TIFF";

/// Why a file is not read, if it is of a known kind that is not.
pub(super) fn refused(name: &str, data: &[u8]) -> Option<String> {
    let at = |k: usize, magic: &[u8]| data.get(k..).is_some_and(|d| d.starts_with(magic));
    let extension = name.rsplit_once('.').map(|(_, e)| e.to_ascii_lowercase());
    let camera = extension.is_some_and(|e| CAMERA.contains(&e.as_str()));
    let raw = (camera && super::tiff::is_tiff(data))
        || (at(0, b"II*\0") && at(8, b"CR\x02"))
        || at(0, b"FUJIFILMCCD-RAW")
        || at(0, b"FOVb")
        || (at(4, b"ftypcrx"))
        || [b"IIRO", b"IIRS", b"MMOR", b"IIU\0"].iter().any(|m| at(0, *m))
        || at(0, b"\0MRM");
    if raw {
        return Some(RAW.to_owned());
    }
    let kind = if at(0, b"RIFF") && at(8, b"WEBP") {
        "WebP"
    } else if at(0, b"GIF8") {
        "GIF"
    } else if at(0, b"BM") && at(6, b"\0\0\0\0") {
        "BMP"
    } else if at(0, b"\x76\x2f\x31\x01") {
        "OpenEXR"
    } else if at(4, b"ftyp") {
        "HEIF or AVIF"
    } else if at(0, b"\0\0\0\x0cjP  ") || at(0, b"\xff\x4f\xff\x51") {
        "JPEG 2000"
    } else if at(0, b"\xff\x0a") || at(0, b"\0\0\0\x0cJXL ") {
        "JPEG XL"
    } else if at(0, b"SIMPLE  =") {
        "FITS"
    } else if at(0, b"PK\x03\x04") {
        "ZIP (or .npz)"
    } else if at(0, b"%PDF") {
        "PDF"
    } else {
        return None;
    };
    Some(format!("a {kind} file is not read; convert it to PNG, TIFF or .npy"))
}
