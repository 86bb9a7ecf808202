# Sourced by the scripts that build. ccache finds what another clone of the same commit compiled.
export CCACHE_BASEDIR="$PWD"
export CCACHE_NOHASHDIR=1
# The tests' precompiled header: ccache's manual, "Precompiled headers".
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
