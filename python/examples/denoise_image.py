"""Noise is taken out of an image; how much of it there is, and lambda, are estimated."""

import numpy as np
from meshes import checks, picture

import proxel

truth = checks()
noisy = truth + 0.1 * np.random.default_rng(0).standard_normal(truth.shape)
clean, info = proxel.denoise(noisy, truth=truth)
print(
    f"lambda {info.lambda_:.1f}: {info.psnr_input:.1f} dB before, {info.psnr:.1f} dB after, gap {info.relative_gap:.1e}"
)
assert info.psnr > info.psnr_input + 5
info.save_preview(picture())
