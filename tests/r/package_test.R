# The package against the program's exports and the vendor's CSV; any stop() is a failure.
library(sixpoint)
program <- Sys.getenv("SIXPOINT_PROGRAM")
shared <- Sys.getenv("SIXPOINT_SHARED")
run <- function(...) stopifnot(system2(program, c(...), stdout = FALSE, stderr = FALSE) == 0)
rows_of <- function(csv) as.matrix(utils::read.csv(csv, skip = 10, header = TRUE))

same_as_export <- function(path) {
  run("export", shQuote(path), "--csv", "bare.csv", "--no-fill", "--force")
  bare <- read_gt3x_sixpoint(path)
  expected <- rows_of("bare.csv")
  stopifnot(inherits(bare, "activity"), identical(colnames(bare), c("X", "Y", "Z")))
  stopifnot(nrow(bare) == nrow(expected), all(unname(bare[, ]) == unname(expected)))
  frame <- read_gt3x_sixpoint(path, asDataFrame = TRUE)
  stopifnot(inherits(frame, "activity_df"), inherits(frame, "data.frame"))
  stopifnot(identical(names(frame), c("X", "Y", "Z", "time")), inherits(frame$time, "POSIXct"))
  stopifnot(all(frame$X == bare[, 1]), all(frame$Z == bare[, 3]))
  again <- as.data.frame(bare)
  stopifnot(max(abs(as.numeric(again$time) - as.numeric(frame$time))) < 0.0051)
  for (name in c("start_time", "stop_time", "sample_rate", "features", "missingness", "header",
                 "firmware", "serial_prefix", "old_version", "last_sample_time")) {
    stopifnot(!is.null(attr(frame, name)), !is.null(attr(bare, name)))
  }
  frame
}

frame <- same_as_export("day1.gt3x")
stopifnot(nrow(head(frame)) == 6, inherits(head(frame), "activity_df"))

# Zeros in place of missing seconds: what is not zero is what was recorded, and times have no hole.
affected <- file.path(shared, "data/wgt3x-bt-affected/MOS2A45130451.gt3x")
if (file.exists(affected)) {
  bare <- same_as_export(affected)
  full <- read_gt3x_sixpoint(affected, asDataFrame = TRUE, imputeZeroes = TRUE)
  gaps <- attr(full, "missingness")
  stopifnot(nrow(full) == nrow(bare) + sum(gaps$n_missing[gaps$n_missing <= 3600 * 30]))
  first <- full$time >= gaps$time[1] & full$time < gaps$time[1] + gaps$n_missing[1] / 30
  stopifnot(sum(first) == gaps$n_missing[1], all(full$X[first] == 0), all(full$Z[first] == 0))
  for (name in c("gt9x/TAS1H30182785_2019-09-17.gt3x", "nhanes/NEO1B34100019.gt3x")) {
    same_as_export(file.path(shared, "data", name))
  }
} else {
  message("SKIPPED, NOT PASSED: ", affected, " is not there")
}

said <- tryCatch(read_gt3x_sixpoint("gaps.gt3x"), warning = conditionMessage)
stopifnot(identical(said, "missingness has the first 10000 of 10001 gaps"))
stopifnot(attr(read_gt3x_sixpoint("twice.gt3x"), "time_zone") == "-04:00:00")

# A mistyped argument is named; where read.gt3x unpacks changes nothing.
said <- tryCatch(read_gt3x_sixpoint("day1.gt3x", imputeZeros = TRUE), warning = conditionMessage)
stopifnot(identical(said, "not used: imputeZeros; see args(read_gt3x_sixpoint)"))
stopifnot(nrow(read_gt3x_sixpoint("day1.gt3x", exdir = tempdir())) == nrow(frame))

# Only raw counts are refused, and not what has a calibration.json beside samples in g.
for (name in c("scaled.gt3x", "calibrated.agdc", "in_g.agdc")) {
  x <- same_as_export(name)
  stopifnot(nrow(x) == 32, all(x$X == 0), all(x$Y == 0), all(x$Z == 1))
}
error <- tryCatch(read_gt3x_sixpoint("raw.agdc"), sixpoint_error = function(e) e)
stopifnot(error$code == "bad_data", grepl("raw counts", error$what))

# Without a Start Date, times count from the first sample.
frame <- same_as_export("undated.gt3x")
x <- read_gt3x_sixpoint("undated.gt3x")
stopifnot(identical(attr(x, "time_index"), as.integer(round(0:29 * 100 / 30))))
stopifnot(as.numeric(attr(x, "start_time")) == 1428588240, is.na(attr(x, "header")$`Start Date`))
stopifnot(attr(frame, "start_time") == attr(x, "start_time"))

broken <- tempfile(fileext = ".gt3x")
writeBin(raw(100), broken)
error <- tryCatch(read_gt3x_sixpoint(broken), sixpoint_error = function(e) e)
stopifnot(inherits(error, "sixpoint_error"), error$code == "bad_data", nzchar(error$hint))
stopifnot(grepl(error$hint, conditionMessage(error), fixed = TRUE))

found <- scan_16cpan03(c("day1.gt3x", broken))
stopifnot(identical(found$verdict, c("affected", "unreadable")), attr(found, "summary")[["affected"]] == 1)
away <- tryCatch(scan_16cpan03("day1.gt3x", store = "~/none.db"), sixpoint_error = function(e) e)
stopifnot(away$code == "no_input", away$where == path.expand("~/none.db"), away$where != "~/none.db")
repaired <- repair_16cpan03("day1.gt3x", "out", scan = TRUE)
stopifnot(repaired$status == "repaired", file.exists(repaired$output))
stopifnot(repaired$still_error_after_mg < repaired$still_error_before_mg)
stopifnot(scan_16cpan03(repaired$output)$verdict == "not_affected")
linked <- repair_16cpan03(repaired$output, "whole", scan = TRUE, link_unaffected = "hard")
stopifnot(linked$status == "already_repaired", file.exists(linked$linked), is.na(linked$output))
cat("the package answers as the program does\n")
