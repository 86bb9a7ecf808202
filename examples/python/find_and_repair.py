"""Find affected recordings in a folder, repair them, and show ENMO before and after.

    find_and_repair.py FOLDER OUTPUT

Repaired files go into OUTPUT, and for each a picture NAME.png. Needs numpy and matplotlib.
"""

# %% What the script needs
import pathlib
import sys

import matplotlib
import numpy as np
import sixpoint

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (behind the choice of where to draw)

folder, output = (pathlib.Path(argument) for argument in sys.argv[1:3])

# %% Which files are affected?
found = sixpoint.scan(folder)
print(f"{found.summary['affected']} of {found.summary['files']} files are affected")
affected = [file.path for file in found.files if file.verdict == "affected"]

# %% Repair them with constants from their own still periods
result = sixpoint.repair(affected, output, scan=True)
for file in result.files:
    error = file.still_error_mg
    print(f"{file.status:15} {file.input}: {error['before']} mg -> {error['after']} mg at rest")


# %% ENMO: what the acceleration's magnitude has beyond 1 g, on average over a minute
def enmo_mg(path, epoch_s=60):
    """Times and ENMO in mg, epoch by epoch, in bounded memory."""
    times, values = [], []
    rate = int(sixpoint.inspect(path).sample_rate_hz)
    for block in sixpoint.stream(path, rows=rate * epoch_s):
        magnitude_g = np.linalg.norm(block.acceleration, axis=1)
        times.append(block.time[0])
        values.append(1000 * np.maximum(magnitude_g - 1, 0).mean())
    return np.array(times), np.array(values)


# %% A picture for each repaired file
for file in result.files:
    if file.status != "repaired":
        continue
    times, before = enmo_mg(file.input)
    _, after = enmo_mg(file.output)
    print(f"{file.serial}: ENMO {before.mean():.1f} mg before, {after.mean():.1f} mg after")
    figure, axes = plt.subplots(figsize=(9, 3))
    axes.plot(times, before, label="as recorded")
    axes.plot(times, after, label="repaired")
    axes.set(ylabel="ENMO in mg", title=file.serial)
    axes.legend()
    figure.savefig(output / (pathlib.Path(file.output).stem + ".png"))
    plt.close(figure)
