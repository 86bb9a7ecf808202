// The labels of a station on their way to its printer: on the disk first, then to the printer,
// again and again until it took them, also after a restart of the program.
//
//   SIXPOINT_ASSIGN(const auto printer,
//                   LabelPrinter::open(env, "/dev/usb/lp0", "state/labels", send));
//   SIXPOINT_CHECK(printer->add({"0123abcd", "MOS2A45130007", "^XA^XZ\n"}));
//   std::cout << printer->to_json();
//
// add() answers when the label is on the disk, and waits for no printer: a thread of its own sends,
// the oldest first, one at a time. After a failure it waits retry_pause_s(). A label is sent at
// least once: where the program is killed between the printer's answer and the note of it, it is
// printed twice. A label that the printer has not confirmed (printer_connection.h) is not sent
// again: a person looks, and asks for it again.
//
// Labels are FOLDER/RUN.json; one that cannot be read is renamed to RUN.json.unreadable.
// All functions may be called from any thread.
#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "base/env.h"
#include "base/result.h"
#include "station/printing/printer_connection.h"

namespace sixpoint::station {

// The id of a run is hexadecimal, with at most 64 digits; anything else could be a path.
bool is_run_id(std::string_view run);

struct Label {
  std::string run;  // id
  std::string serial;
  std::string zpl;
};

// send_label() of one printer. Must answer soon after a stop was asked for.
using LabelSender = std::function<Result<Sent>(std::string_view zpl, const std::stop_token& stop)>;

struct LabelPrinterOptions {
  double first_pause_s = 2;         // a printer that is being switched on
  double longest_pause_s = 60;      // a printer that is away for a day is asked once a minute
  std::size_t most_waiting = 1000;  // three shifts; more are refused
  std::size_t remembered = 200;     // labels that were printed, so that none is printed twice
};

// Before the next attempt, after `failures` in a row: doubled each time, from the first to the
// longest.
double retry_pause_s(int failures, const LabelPrinterOptions& options);

class LabelPrinter {
 public:
  // Goes on with what waits in `folder`, which is made where it is not there. `env` outlives it.
  static Result<std::unique_ptr<LabelPrinter>> open(Env& env, const std::string& printer,
                                                    const std::string& folder, LabelSender send,
                                                    const LabelPrinterOptions& options = {});
  ~LabelPrinter();  // what waits is on the disk
  LabelPrinter(const LabelPrinter&) = delete;
  LabelPrinter& operator=(const LabelPrinter&) = delete;

  // Nothing where this run's label was added before. usage for an id that is none, io for too many.
  Status add(const Label& label);
  // The same, also where it was printed; the printer is tried at once.
  Status add_again(const Label& label);
  // {printer, labels[{run, serial, state (waiting, printed, unconfirmed), problem, failures}]}: all
  // that wait, and the latest others.
  nlohmann::ordered_json to_json() const;
  std::uint64_t changes() const;

 private:
  struct Impl;
  explicit LabelPrinter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sixpoint::station
