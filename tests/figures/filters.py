"""Our filter and smoother beside plain ones on every real recording: `python -m tests.figures.filters`.

Plain ones are Butterworth filters of second order at 10 Hz, forwards, and forwards and backwards (`scipy.signal`).
For each, over the three channels of force: *noise* is the scatter about straight lines of 0.25 s in the quietest
quarter of the recording (`conditioning.noise`), and *lag* the shift of time by which the filtered force fits the
recorded one best where it changes, both less their means, to a hundredth of a sample by a parabola. *Lost* is the
rms of what is filtered away over the tenth of the samples where the recorded force, averaged over 20 ms, changes
most: a touch-down that is smeared is lost.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt
from skillframe_recordings.conditioning.offline import filter_wrench, smooth
from skillframe_recordings.conditioning.wrench_model import model_of

from skillframe.demonstration.contact import noise_figures
from skillframe.demonstration.record import Demonstration
from skillframe.frames import Float, norm
from tests.figures.recorded import recordings

CORNER, SPAN_S, AVERAGED_S = 10.0, 0.1, 0.02


def plain(d: Demonstration, zero_phase: bool) -> Float:
    """Force (T, 3) through a Butterworth filter."""
    sos = butter(2, CORNER, fs=d.rate, output="sos")
    force = d.wrench[:, :3]
    if zero_phase:
        return np.asarray(sosfiltfilt(sos, force, axis=0))
    start = sosfilt_zi(sos)[:, :, None] * force[0]
    return np.asarray(sosfilt(sos, force, axis=0, zi=start)[0])


def averaged(d: Demonstration) -> Float:
    """Force (T, 3) averaged over 20 ms around each sample."""
    width = max(1, round(AVERAGED_S * d.rate)) | 1
    kernel = np.full(width, 1.0 / width)
    return np.stack([np.convolve(np.pad(c, width // 2, mode="edge"), kernel, "valid") for c in d.wrench[:, :3].T], 1)


def lag(d: Demonstration, filtered: Float) -> float:
    """By how much the filtered force comes late [ms]."""
    most = round(SPAN_S * d.rate)
    wanted, got = np.gradient(averaged(d), axis=0), np.gradient(filtered, axis=0)
    inner = slice(most, len(d) - most)
    fits = np.array([float((np.roll(wanted, k, axis=0)[inner] * got[inner]).sum()) for k in range(-most, most + 1)])
    best = int(np.clip(np.argmax(fits), 1, len(fits) - 2))
    before, middle, after = fits[best - 1 : best + 2]
    return float(1e3 * (best - most + 0.5 * (before - after) / (before - 2.0 * middle + after)) / d.rate)


def lost(d: Demonstration, filtered: Float) -> float:
    """Root mean square of what is filtered away where the force changes most, per channel [N]."""
    change = norm(np.gradient(averaged(d), axis=0))
    busy = change >= np.quantile(change, 0.9)
    return float(np.sqrt(np.mean((d.wrench[busy, :3] - filtered[busy]) ** 2)))


def noise(d: Demonstration, filtered: Float) -> float:
    """Scatter in the quietest quarter, per channel [N]."""
    return float(np.sqrt(np.mean(noise_figures(d.time, np.hstack([filtered, filtered])).quiet[:3] ** 2)))


def main() -> None:
    """Print the table."""
    print("| recording | corner | | noise [N] | lag [ms] | lost [N] |")
    for name, d in recordings().items():
        corner = model_of(d).corner(1.0 / d.rate)[0]
        ways = {
            "recorded": d.wrench[:, :3], "smoother": smooth(d).wrench[:, :3], "zero phase": plain(d, zero_phase=True),
            "filter": filter_wrench(d).wrench[:, :3], "causal": plain(d, zero_phase=False),
        }  # fmt: skip
        for way, force in ways.items():
            print(f"| {name} | {corner:.1f} Hz | {way} | {noise(d, force):.4f} | {lag(d, force):.1f} | "
                  f"{lost(d, force):.3f} |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
