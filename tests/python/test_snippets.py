"""Every example of docs/python.md runs, and so does the script of examples/python."""

import builtins
import contextlib
import io
import re
import shutil
import subprocess
import sys

from made import SOURCE, InFolder, simulated


class Documents(InFolder):
    def test_python_md(self):
        text = (SOURCE / "docs/python.md").read_text()
        blocks = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
        self.assertGreater(len(blocks), 5)
        shutil.copy(simulated(), self.folder / "unit.gt3x")
        names = {}
        said = io.StringIO()
        with contextlib.chdir(self.folder), contextlib.redirect_stdout(said):
            for i, block in enumerate(blocks):
                exec(compile(block, f"docs/python.md, block {i + 1}", "exec"), names)
        self.assertEqual(names["affected"], ["unit.gt3x"])
        self.assertEqual(names["result"].files[0].status, "repaired")
        self.assertIn("no_input", said.getvalue())

    def test_the_table_of_exceptions(self):
        import sixpoint

        text = (SOURCE / "docs/python.md").read_text()
        for name, also in re.findall(r"^\| `(\w+Error)` \| `(\w+)` \|", text, re.MULTILINE):
            self.assertTrue(issubclass(getattr(sixpoint, name), getattr(builtins, also)), name)

    def test_find_and_repair(self):
        folder = self.folder / "archive"
        folder.mkdir()
        shutil.copy(simulated(1), folder / "a.gt3x")
        shutil.copy(simulated(2), folder / "b.gt3x")
        output = self.folder / "repaired"
        done = subprocess.run(
            [sys.executable, SOURCE / "examples/python/find_and_repair.py", folder, output],
            capture_output=True, text=True,
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("2 of 2 files are affected", done.stdout)
        for name in ("a", "b"):
            self.assertTrue((output / f"{name}.gt3x").exists())
            self.assertEqual((output / f"{name}.png").read_bytes()[:4], b"\x89PNG")
