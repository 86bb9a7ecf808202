#!/usr/bin/env bash
# The jig run in a real terminal (tmux): the prompts come, u and Enter undoes, s and Enter stops. With the
# unit on emulated USB and a hand that turns it: a slip, an undo, Ctrl-C, and the run goes on.
#   terminal.sh SIXPOINT_PROGRAM [USB_STATION]
set -euo pipefail
program=$1 usb_station=${2:-}
tests=$(cd "$(dirname "$0")/.." && pwd)
skip() { "$tests/skip.sh" "$*"; exit $?; }
command -v tmux >/dev/null || skip "tmux is not installed (scripts/install_packages.sh test)"
folder=$(mktemp -d)
tmux=(tmux -S "$folder/socket" -f /dev/null)
trap '"${tmux[@]}" kill-server 2>/dev/null || true; rm -rf "$folder"' EXIT

# grep reads the whole screen (no -q): with pipefail, one that stops at the first hit makes the writer fail.
shows() { screen | grep -F -- "$1" >/dev/null; }
screen() { "${tmux[@]}" capture-pane -p -S - -t t 2>/dev/null; }
wait_for() { # TEXT
  for _ in $(seq 600); do
    if shows "$1"; then return 0; fi
    sleep 0.1
  done
  echo "FAILED: '$1' never came; the terminal shows:"
  screen
  exit 1
}

"${tmux[@]}" new-session -d -s t -x 160 -y 60 "env HOME=$folder XDG_DATA_HOME=$folder sh"
run() { "${tmux[@]}" send-keys -t t "clear; $program jig --store $folder/store.db --device virtual:seed=7,jig=auto,pace=8 --operator Ada; echo ended with \$?" Enter; }

run
wait_for "u and Enter: undo the last pose"
wait_for "turn the unit to +x: its x axis points up"
"${tmux[@]}" send-keys -t t u Enter
wait_for "is taken back"
wait_for "run is complete"
wait_for ": pass"
wait_for "ended with 0"
shows "constants stored as" || { echo "FAILED: nothing was stored"; screen; exit 1; }

"${tmux[@]}" send-keys -t t "clear" Enter
"${tmux[@]}" clear-history -t t
run
wait_for "-z is taken"
"${tmux[@]}" send-keys -t t s Enter
wait_for "stopped by the operator"
wait_for "ended with 3"
echo "the terminal run: undo, stop, and a whole run"

[ -n "$usb_station" ] || skip "the run by hand needs umockdev (Debian packages libumockdev-dev and umockdev)"
hand=$folder/hand
mkfifo "$hand"
"${tmux[@]}" send-keys -t t "clear" Enter
"${tmux[@]}" clear-history -t t
"${tmux[@]}" send-keys -t t "SIXPOINT_HAND=$hand $usb_station $program jig --jig manual --device {device} --store $folder/usb.db --operator Ada --write; echo all over" Enter
wait_for "u and Enter: undo the last pose"
# Where the unit lies. Nobody turns it again because a question is repeated: that would be another movement.
lies=""
turn() {
  lies=$1
  echo "turn $1" >"$hand"
}
# Turns the unit to where the terminal asks for it, until TEXT is there.
turn_until() { # TEXT
  local text asked
  for _ in $(seq 1500); do
    text=$(screen || true)
    if grep -qF -- "$1" <<<"$text"; then return 0; fi
    # Nothing may be asked yet.
    asked=$(sed -nE 's/.*(turn the unit to|turn it to|lay the unit on) ([+-][xyz]).*/\2/p' <<<"$text" | tail -1)
    if [ -n "$asked" ] && [ "$asked" != "$lies" ]; then turn "$asked"; fi
    sleep 0.1
  done
  echo "FAILED: '$1' never came; the terminal shows:"
  screen
  exit 1
}
turn_until "+x is taken"
turn -z
wait_for "refused: -z is done already"
"${tmux[@]}" send-keys -t t u Enter
wait_for "+x is taken back"
turn_until "-x is taken"
"${tmux[@]}" send-keys -t t C-c
echo wait >"$hand"
wait_for "the program has ended"
# The emulated kernel does not always notice that a killed program's files are closed; a new plug it does.
printf 'unplug\nplug\nstart\n' >"$hand"
lies=""
wait_for "goes on; it has "
taken=$(screen | sed -nE 's/.*goes on; it has ([0-9]+) placements.*/\1/p')
[ "$taken" -ge 3 ] || { echo "FAILED: only $taken placements were kept"; screen; exit 1; }
turn_until "the run is complete"
wait_for ": pass"
wait_for "constants stored as"
echo wait >"$hand"
echo end >"$hand"
wait_for "all over"
[ -z "$(find "$folder" -name run.json)" ] || { echo "FAILED: the run is still on the disk"; exit 1; }
echo "the run by hand: a slip, an undo, Ctrl-C, and it went on with $taken placements"
