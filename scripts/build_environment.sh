# Sourced by the scripts that build. ccache finds what another clone of the same commit compiled.
export CCACHE_BASEDIR="$PWD"
export CCACHE_NOHASHDIR=1
# Precompiled headers: ccache's manual.
export CCACHE_SLOPPINESS=pch_defines,time_macros

# configure PRESET [option...]: quiet unless it fails.
configure() {
  local preset=$1 log
  shift
  log=$(mktemp)
  if ! cmake --preset "$preset" "$@" >"$log" 2>&1; then
    cat "$log" >&2
    rm -f "$log"
    return 1
  fi
  rm -f "$log"
}
