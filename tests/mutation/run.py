"""Breaks one place at a time in a copy of the tree, and looks whether the tests notice.

usage: run.py [--list] [--tree FOLDER] [--jobs N] [NAME...]

--tree FOLDER keeps the copy and its build there, so that the next call builds only what changed.
Exit status: 0 when every mutation was noticed, 1 otherwise.
"""
import argparse
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

from mutations import MUTATIONS

SOURCE = pathlib.Path(__file__).resolve().parents[2]
# What a mutation leaves unused is no error. (Another compiler option would compile everything anew.)
UNUSED = ''.join(f'#pragma GCC diagnostic ignored "-Wunused-{what}"\n'
                 for what in ('variable', 'parameter', 'but-set-variable', 'function', 'const-variable'))


def copy_tree(tree):
    """The files that git knows, as they are in the working folder."""
    names = subprocess.run(['git', 'ls-files', '-z'], cwd=SOURCE, check=True, capture_output=True).stdout
    for name in filter(None, names.decode().split('\0')):
        source, target = SOURCE / name, tree / name
        if target.exists() and target.read_bytes() == source.read_bytes():
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, target)
    shared = SOURCE.parent / 'shared'
    if shared.exists() and not (tree.parent / 'shared').exists():
        (tree.parent / 'shared').symlink_to(shared)


def build(tree, jobs, target):
    return subprocess.run(
        ['bash', '-c', 'source scripts/build_environment.sh && '
         '{ [ -e build/build.ninja ] || configure release -DSIXPOINT_TESTS=ON -DSIXPOINT_BENCH=ON; } && '
         'ninja -C build -j"$0" "$1"', str(jobs), target],
        cwd=tree, capture_output=True, text=True)


def run_tests(tree, room, pattern):
    """The names of the tests that failed; None where the program ended without a result."""
    program = tree / 'build/tests' / room / f'{room}_tests'
    try:
        done = subprocess.run([program, f'--gtest_filter={pattern}', '--gtest_brief=1'], cwd=tree / 'build',
                              capture_output=True, text=True, timeout=600, errors='replace')
    except subprocess.TimeoutExpired:
        return {'(no end within 600 s)'}, 1
    ran = re.search(r'(\d+) tests? from .* ran', done.stdout)
    failed = set(re.findall(r'^\[  FAILED  \] ([\w/.]+)', done.stdout, re.M))
    if done.returncode != 0 and not failed:
        failed = {f'(ended with {done.returncode})'}
    return failed, int(ran.group(1)) if ran else 0


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument('names', nargs='*')
    parser.add_argument('--list', action='store_true')
    parser.add_argument('--tree')
    parser.add_argument('--jobs', type=int, default=2)
    given = parser.parse_args()
    chosen = [m for m in MUTATIONS if not given.names or any(m.name.startswith(n) for n in given.names)]
    if not chosen:
        sys.exit(f'no mutation has such a name; --list shows all {len(MUTATIONS)}')
    if given.list:
        for m in chosen:
            print(f'{m.name:24} {m.file:44} {m.what}')
        return
    tree = pathlib.Path(given.tree or tempfile.mkdtemp(prefix='sixpoint-mutation-')) / 'sixpoint'
    tree.mkdir(parents=True, exist_ok=True)
    copy_tree(tree)
    unnoticed = []
    # Room by room: its tests are built whole once, and must pass before anything is broken.
    for room in sorted({m.room for m in chosen}):
        mine = [m for m in chosen if m.room == room]
        made = build(tree, given.jobs, f'{room}_tests')
        if made.returncode != 0:
            sys.exit(f'{room}_tests does not build:\n{made.stdout[-3000:]}{made.stderr[-1000:]}')
        failed, ran = run_tests(tree, room, ':'.join(m.tests for m in mine))
        if failed or ran == 0:
            sys.exit(f'{room}: {ran} tests ran before anything was broken, and failed: {sorted(failed)}')
        for m in mine:
            path = tree / m.file
            whole = path.read_text()
            if whole.count(m.before) != 1:
                sys.exit(f'{m.name}: its text is {whole.count(m.before)} times in {m.file}; change mutations.py')
            try:
                path.write_text(UNUSED + whole.replace(m.before, m.after))
                made = build(tree, given.jobs, f'{room}_tests')
                if made.returncode != 0:
                    sys.exit(f'{m.name} does not compile:\n{made.stdout[-3000:]}')
                failed, _ = run_tests(tree, room, m.tests)
            finally:
                path.write_text(whole)
            print(f'{"noticed" if failed else "NOT NOTICED":12} {m.name:24} {", ".join(sorted(failed))[:110]}', flush=True)
            if not failed:
                unnoticed.append(m.name)
    print(f'{len(chosen) - len(unnoticed)} of {len(chosen)} noticed')
    sys.exit(1 if unnoticed else 0)


if __name__ == '__main__':
    main()
