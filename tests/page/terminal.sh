#!/usr/bin/env bash
# The jig run in a real terminal (tmux): the prompts come, u and Enter undoes, s and Enter stops.
#   terminal.sh SIXPOINT_PROGRAM
set -euo pipefail
program=$1
command -v tmux >/dev/null || { echo "SKIPPED: tmux is not installed (scripts/install_packages.sh test)"; exit 77; }
folder=$(mktemp -d)
tmux=(tmux -S "$folder/socket" -f /dev/null)
trap '"${tmux[@]}" kill-server 2>/dev/null || true; rm -rf "$folder"' EXIT

screen() { "${tmux[@]}" capture-pane -p -S - -t t 2>/dev/null; }
wait_for() { # TEXT
  for _ in $(seq 600); do
    if screen | grep -qF -- "$1"; then return 0; fi
    sleep 0.1
  done
  echo "FAILED: '$1' never came; the terminal shows:"
  screen
  exit 1
}

"${tmux[@]}" new-session -d -s t -x 110 -y 60 "sh"
run() { "${tmux[@]}" send-keys -t t "clear; $program jig --store $folder/store.db --device virtual:seed=7,jig=auto,pace=8 --operator Ada; echo ended with \$?" Enter; }

run
wait_for "u and Enter: undo the last pose"
wait_for "turn the unit to +x: its x axis points up"
"${tmux[@]}" send-keys -t t u Enter
wait_for "is taken back"
wait_for "run is complete"
wait_for ": pass"
wait_for "ended with 0"
screen | grep -q "constants stored as" || { echo "FAILED: nothing was stored"; screen; exit 1; }

"${tmux[@]}" send-keys -t t "clear" Enter
"${tmux[@]}" clear-history -t t
run
wait_for "-z is taken"
"${tmux[@]}" send-keys -t t s Enter
wait_for "stopped by the operator"
wait_for "ended with 3"
echo "the terminal run: undo, stop, and a whole run"
