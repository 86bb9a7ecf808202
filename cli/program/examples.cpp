#include "cli/program/examples.h"

namespace sixpoint::cli {

namespace {

// One example a line: tests/docs/run_examples.sh reads this file.
// clang-format off
constexpr CommandExamples kExamples[] = {
    {"simulate", {
        "sixpoint simulate --scenario scenario.json -o day1.gt3x",
        "sixpoint simulate --scenario protocol.json -o bundle"}},
    {"inspect", {
        "sixpoint inspect day1.gt3x",
        "sixpoint inspect damaged.gt3x --salvage"}},
    {"scan", {
        "sixpoint scan archive                          # exits with 1: affected files were found",
        "sixpoint scan archive --units units.csv --json  # exits with 1"}},
    {"repair", {
        "sixpoint repair archive -o repaired",
        "sixpoint repair archive -o repaired --resume --report"}},
    {"export", {
        "sixpoint export day1.gt3x --csv day1.csv --time",
        "sixpoint export archive -o csv --gzip"}},
    {"compare", {
        "sixpoint compare day1.gt3x day1.gt3x",
        "sixpoint compare day1.gt3x day1.gt3x --html compared.html"}},
    {"impact", {
        "sixpoint impact archive/day1.gt3x repaired/day1.gt3x",
        "sixpoint impact archive repaired --cut moderate=100 --csv impact.csv"}},
    {"solve", {
        "sixpoint solve archive/day1.gt3x",
        "sixpoint solve archive/day1.gt3x --json"}},
    {"jig", {
        "sixpoint jig --device virtual:seed=7,jig=auto",
        "sixpoint jig --device virtual:seed=8,jig=auto --operator Ada --write --certificate certificate.pdf --record session.zip"}},
    {"capture", {
        "sixpoint capture --device virtual:seed=7,jig=auto -o calibration.gt3x",
        "sixpoint capture --device virtual:seed=8,jig=auto --sides corners -o calibration-8.gt3x --constants-out constants.json"}},
    {"limits print", {
        "sixpoint limits print > limits.toml",
        "sixpoint limits print limits.toml --json"}},
    {"limits check", {
        "sixpoint limits check limits.toml",
        "sixpoint limits check limits.toml --json"}},
    {"certificate", {
        "sixpoint certificate RUN -o again.pdf",
        "sixpoint certificate RUN -o again.dcc.xml --json"}},
    {"check-unit add", {
        "sixpoint check-unit add CHECK1 --station bench-3 --operator Eve --reason \"watches bench 3\"",
        "sixpoint check-unit add CHECK2 --station bench-3 --operator Eve --reason \"dropped\" --expect zero_high"}},
    {"check-unit chart", {
        "sixpoint check-unit chart",
        "sixpoint check-unit chart --html check-units.html"}},
    {"check-unit remove", {
        "sixpoint check-unit remove CHECK1 --station bench-3 --operator Eve --reason \"its cable broke\"",
        "sixpoint check-unit remove CHECK2 --station bench-3 --operator Eve --reason \"not needed\" --json"}},
    {"station-lock status", {
        "sixpoint station-lock status --station bench-3",
        "sixpoint station-lock status --station bench-3 --json"}},
    {"station-lock sign", {
        "sixpoint station-lock sign --station bench-3 --operator Eve --reason \"seat cleaned\"",
        "sixpoint station-lock sign --station bench-3 --operator Eve --reason \"new jig\" --new-baseline"}},
    {"retest", {
        "sixpoint retest SERIAL",
        "sixpoint retest SERIAL --release --operator Eve --reason \"new battery\""}},
    {"operator add", {
        "sixpoint operator add Ada",
        "sixpoint operator add Eve --role engineer"}},
    {"operator list", {
        "sixpoint operator list",
        "sixpoint operator list --json"}},
    {"operator disable", {
        "sixpoint operator disable Ada",
        "sixpoint operator disable Eve --json  # exits with 78: the last one stays"}},
    {"statistics", {
        "sixpoint statistics --by station",
        "sixpoint statistics --by operator --from 2024-01-01 --html statistics.html"}},
    {"gage-rr", {
        "sixpoint gage-rr readings.csv",
        "sixpoint gage-rr readings.csv --json"}},
    {"units", {
        "sixpoint units",
        "sixpoint units --json"}},
    {"history", {
        "sixpoint history SERIAL",
        "sixpoint history SERIAL --json"}},
    {"audit head", {
        "sixpoint audit head",
        "sixpoint audit head --json > head.json"}},
    {"audit verify", {
        "sixpoint audit verify",
        "sixpoint audit verify --head $(sixpoint audit head)"}},
    {"store export", {
        "sixpoint store export -o store.jsonl",
        "sixpoint store export --csv -o tables"}},
    {"store import", {
        "sixpoint store import store.jsonl --store copy.db",
        "sixpoint store import store.jsonl --store copy.db --json"}},
    {"store backup", {
        "sixpoint store backup -o backup.db",
        "sixpoint store backup -o \"backup-$(date +%F).db\""}},
    {"store catch-up", {
        "sixpoint store catch-up",
        "sixpoint store catch-up --json"}},
    {"store withdraw", {
        "sixpoint store withdraw CONSTANTS --why \"the jig was out of level\" --operator Eve",
        "sixpoint store withdraw CONSTANTS --why \"it was dropped\" --operator Eve --json"}},
    {"store reinstate", {
        "sixpoint store reinstate CONSTANTS --why \"it was another jig\" --operator Eve",
        "sixpoint store reinstate CONSTANTS --why \"it was another unit\" --operator Eve --json"}},
    {"store prefer", {
        "sixpoint store prefer CONSTANTS --why \"measured after the drop\" --operator Eve",
        "sixpoint store prefer CONSTANTS --why \"the better jig\" --operator Eve --json"}},
    {"store note", {
        "sixpoint store note units SERIAL --why \"came back with a cracked case\"",
        "sixpoint store note runs RUN --why \"the window was open\" --operator Ada"}},
    {"store recall", {
        "sixpoint store recall",
        "sixpoint store recall CONSTANTS --json"}},
    {"store jig", {
        "sixpoint store jig JIG",
        "sixpoint store jig JIG --json"}},
    {"store yield", {
        "sixpoint store yield",
        "sixpoint store yield --from 2026-01-01 --json"}},
    {"store due", {
        "sixpoint store due --days 365",
        "sixpoint store due --days 0 --json"}},
    {"store trend", {
        "sixpoint store trend SERIAL",
        "sixpoint store trend SERIAL --json"}},
    {"session show", {
        "sixpoint session show session.zip",
        "sixpoint session show session.zip --json"}},
    {"session minimise", {
        "sixpoint session minimise session.zip --doing identify -o identify.zip",
        "sixpoint session minimise session.zip --replays 20 -o small.zip"}},
    {"session recover", {
        "sixpoint session recover broken.zip",
        "sixpoint session recover broken-too.zip --json"}},
    {"session from-pcap", {
        "sixpoint session from-pcap capture.pcap --bus 3 --device-number 9 -o captured.zip",
        "sixpoint session from-pcap capture.pcap --bus 3 --device-number 9 -o again.zip --json"}},
    {"devices", {
        "sixpoint devices",
        "sixpoint devices --watch --for 1"}},
    {"doctor", {
        "sixpoint doctor",
        "sixpoint doctor --json"}},
    {"virtual", {
        "sixpoint virtual --usbip 0",
        "sixpoint virtual --usbip 0 --count 4 --jig"}},
    {"station", {
        "sixpoint station --device virtual:seed=7,pace=real",
        "sixpoint station --device virtual:seed=7,pace=real --store bench.db --station bench-3"}},
    {"archive plan", {
        "sixpoint archive plan archive -o plan --shards 2",
        "sixpoint archive plan archive -o plan-scan --scan"}},
    {"archive run", {
        "sixpoint archive run plan --shard 0 -o repaired-archive",
        "sixpoint archive run plan --shard 1 -o repaired-archive --json"}},
    {"archive submit", {
        "sixpoint archive submit plan -o repaired-archive --dry-run",
        "sixpoint archive submit plan -o repaired-archive --dry-run --sbatch=--partition=long"}},
    {"archive status", {
        "sixpoint archive status plan",
        "sixpoint archive status plan --json"}},
    {"archive merge", {
        "sixpoint archive merge plan",
        "sixpoint archive merge plan --verify --json"}},
    {"archive report", {
        "sixpoint archive report plan -o report.html",
        "sixpoint archive report plan -o report.html --force"}},
    {"gap diagnose", {
        "sixpoint gap diagnose bundle",
        "sixpoint gap diagnose bundle --without tilt,seating --html gap.html"}},
    {"gap challenge", {
        "sixpoint gap challenge --trials 3 --seed 5 --protocol production",
        "sixpoint gap challenge --export bundles --labels labels.jsonl --trials 3 --protocol production"}},
    {"gap answers", {
        "sixpoint gap answers bundles -o answers.jsonl",
        "sixpoint gap answers bundles --method sequential -o sequential.jsonl"}},
    {"gap score", {
        "sixpoint gap score answers.jsonl --labels labels.jsonl",
        "sixpoint gap score sequential.jsonl --labels labels.jsonl --json"}},
    {"gap adopt", {
        "sixpoint gap adopt bundle -o learnt.json",
        "sixpoint gap adopt bundle --scenario learnt.json -o same.json --dry-run"}},
    {"gap report", {
        "sixpoint gap report bundle --scenario learnt.json -o progress.html",
        "sixpoint gap report bundle --scenario learnt.json --json"}},
    {"gap trends", {
        "sixpoint gap trends                # exits with 2: the store holds too few runs",
        "sixpoint gap trends --json         # exits with 2"}},
};
// clang-format on

}  // namespace

std::span<const CommandExamples> command_examples() { return kExamples; }

}  // namespace sixpoint::cli
