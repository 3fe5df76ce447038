"""A photograph that was moved by 9 pixels while it was taken becomes sharp again."""

import numpy as np
from meshes import checks, picture

import proxel

truth = checks(100)
steps = np.linspace(-4, 4, 33)
blurred = np.mean([np.roll(truth, round(s), axis=1) for s in steps], axis=0)[:, 8:-8]
psf = np.bincount(np.round(steps).astype(int) + 4, minlength=9)[None, :] / len(steps)
seen = blurred + 0.005 * np.random.default_rng(0).standard_normal(blurred.shape)

sharp, info = proxel.deblur(seen, psf, truth=truth[:, 8:-8], lambda_=3000.0)
print(f"{info.status}: {info.psnr_input:.1f} dB before, {info.psnr:.1f} dB after")
assert info.psnr > info.psnr_input + 5
info.save_preview(picture())
