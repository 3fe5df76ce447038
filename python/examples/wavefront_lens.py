"""What a coded wavefront sensor has seen of a lens: the phase whose gradient moved the speckles."""

import numpy as np
from meshes import picture

import proxel

n = 96
y, x = np.mgrid[:n, :n] - (n - 1) / 2
noise = np.fft.fft2(np.random.default_rng(0).random((n, n)))
k = np.fft.fftfreq(n)
reference = np.fft.ifft2(noise * np.exp(-200 * (k[:, None] ** 2 + k**2))).real
reference = (reference - reference.min()) / np.ptp(reference)

truth = 0.012 * (x**2 + 0.6 * y**2)
dy, dx = np.gradient(truth)
# Backwards along the gradient, bilinearly: captured(q) = reference(q - grad phi(q)), to first order.
r, c = np.clip(np.indices((n, n)) - [dy, dx], 0, n - 1.001)
i, j, s, t = r.astype(int), c.astype(int), r % 1, c % 1
captured = (1 - s) * ((1 - t) * reference[i, j] + t * reference[i, j + 1]) + s * (
    (1 - t) * reference[i + 1, j] + t * reference[i + 1, j + 1]
)
phi, info = proxel.wavefront(reference, captured)
inner = np.s_[10:-10, 10:-10]
error = (phi - truth)[inner] - (phi - truth)[inner].mean()
print(f"{info.status}: off by {np.sqrt((error**2).mean()) / np.ptp(truth):.1%} of the phase's range")
assert np.sqrt((error**2).mean()) < 0.05 * np.ptp(truth)
info.save_preview(picture())
