#!/usr/bin/env python3
"""Pack the Python package as a wheel, with the interpreter that it was built for.

  make_wheel.py PACKAGE_FOLDER OUTPUT_FOLDER

A wheel is a zip of the package and of its metadata (PyPA, binary distribution format 1.0). The same
files give the same bytes. Prints the path of the wheel.
"""

import base64
import hashlib
import pathlib
import re
import sys
import sysconfig
import zipfile

METADATA = """\
Metadata-Version: 2.1
Name: sixpoint
Version: {version}
Summary: Read, judge and repair recordings of activity monitors (.gt3x, .agdc)
License: MIT
Requires-Python: ==3.{minor}.*
Requires-Dist: numpy
Provides-Extra: pandas
Requires-Dist: pandas; extra == "pandas"
"""

WHEEL = """\
Wheel-Version: 1.0
Generator: sixpoint make_wheel.py
Root-Is-Purelib: false
Tag: {tag}
"""


def main(package, output):
    version = re.search(r'__version__ = "(.+)"', (package / "_version.py").read_text()).group(1)
    minor = sys.version_info.minor
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = f"cp3{minor}-cp3{minor}-{platform}"
    info = f"sixpoint-{version}.dist-info"
    files = {
        f"sixpoint/{path.relative_to(package)}": path.read_bytes()
        for path in sorted(package.rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts
    }
    modules = [name for name in files if name.endswith(".so")]
    if modules != [f"sixpoint/_core{sysconfig.get_config_var('EXT_SUFFIX')}"]:
        sys.exit(f"{package} was not built for this interpreter: it has {modules}")
    files[f"{info}/METADATA"] = METADATA.format(version=version, minor=minor).encode()
    files[f"{info}/WHEEL"] = WHEEL.format(tag=tag).encode()
    record = ""
    for name, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record += f"{name},sha256={digest},{len(content)}\n"
    files[f"{info}/RECORD"] = (record + f"{info}/RECORD,,\n").encode()

    output.mkdir(parents=True, exist_ok=True)
    wheel = output / f"sixpoint-{version}-{tag}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o755 if name.endswith(".so") else 0o644) << 16
            archive.writestr(entry, content)
    print(wheel)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
