#!/usr/bin/env bash
# Installs the Debian 12 packages that are missing; nothing when none is. Sourced or run by the other
# scripts:  install_packages.sh build|test...
# Groups: build (to make the program), test (to test it as CI does), package (to make the .deb), python
# and r (to make and test the packages of these languages), coverage (scripts/coverage.sh).
set -euo pipefail

build_packages=(
  ca-certificates ccache cmake g++ git ninja-build pkg-config
  libcli11-dev libcpp-httplib-dev libeigen3-dev libexpected-dev libfmt-dev libpq-dev libpqxx-dev
  libspdlog-dev libsqlite3-dev libhidapi-dev libudev-dev libusb-1.0-0-dev
  libcairo2-dev libpango1.0-dev librsvg2-dev fonts-dejavu-core
  libdeflate-dev libisal-dev libsqlitecpp-dev libssl-dev libzip-dev nlohmann-json3-dev zlib1g-dev
  libboost-dev libqrencode-dev libtomlplusplus-dev
)
test_packages=(
  clang clang-format clang-tidy libclang-rt-14-dev lld
  chromium-headless-shell tmux
  libceres-dev libgmock-dev libgtest-dev librapidcheck-dev postgresql python3 python3-pytest unzip zip
  libumockdev-dev umockdev
  busybox-static cpio dosfstools kmod mtools qemu-system-x86 udev usbip xz-utils
  libxml2-utils openssl poppler-utils zbar-tools
  dpkg-dev file groff-base lintian systemd
  munge parallel slurm-client slurmctld slurmd snakemake
)
package_packages=(dpkg-dev file)
python_packages=(
  pybind11-dev python3 python3-dev python3-matplotlib python3-numpy python3-pandas python3-venv
)
coverage_packages=(gcovr)
r_packages=(r-base-dev r-cran-jsonlite r-cran-knitr r-cran-markdown)

# The page's tests need Node; a machine that has it from elsewhere keeps it (its package has npm inside
# and does not go together with Debian's).
if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
  test_packages+=(nodejs npm)
fi

wanted=()
for group in "${@:-build}"; do
  case "$group" in
    build) wanted+=("${build_packages[@]}") ;;
    test) wanted+=("${test_packages[@]}") ;;
    package) wanted+=("${package_packages[@]}") ;;
    python) wanted+=("${python_packages[@]}") ;;
    r) wanted+=("${r_packages[@]}") ;;
    coverage) wanted+=("${coverage_packages[@]}") ;;
    *) echo "install_packages.sh: no group '$group'; there are: build test package python r coverage" >&2; exit 64 ;;
  esac
done

missing=()
for package in "${wanted[@]}"; do
  if ! dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'ok installed'; then
    missing+=("$package")
  fi
done
if [ ${#missing[@]} -eq 0 ]; then
  exit 0
fi

if [ "$(id -u)" -ne 0 ]; then
  echo "These Debian packages are missing: ${missing[*]}" >&2
  echo "Run this script as root, or install them with: apt-get install ${missing[*]}" >&2
  exit 77
fi
echo "Installing ${#missing[@]} Debian packages: ${missing[*]}" >&2
log=$(mktemp)
trap 'rm -f "$log"' EXIT
# Another apt may be at work on a fresh machine (unattended upgrades): wait for its lock.
apt=(apt-get -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 -qq)
if ! { "${apt[@]}" update &&
       DEBIAN_FRONTEND=noninteractive "${apt[@]}" install -y --no-install-recommends "${missing[@]}"; } \
     >"$log" 2>&1; then
  tail -n 20 "$log" >&2
  echo "Installing failed; the lines above say why. Check the network and /etc/apt/sources.list." >&2
  exit 69
fi
