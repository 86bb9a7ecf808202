read_gt3x_sixpoint <- function(path, verbose = FALSE, asDataFrame = FALSE, imputeZeroes = FALSE,
                               cleanup = FALSE, ..., add_light = FALSE) {
  # read.gt3x hands these on to what unpacks the archive, which is not done here.
  ignored <- setdiff(names(list(...)), c("", "exdir", "location", "dirname"))
  if (length(ignored) > 0) {
    warning("not used: ", paste(ignored, collapse = ", "), "; see args(read_gt3x_sixpoint)",
            call. = FALSE)
  }
  if (isTRUE(add_light)) {
    stop("light is not read; use 'sixpoint export --records LUX'", call. = FALSE)
  }
  reading <- answer_of(.Call(C_reading_open, one_path(path), isTRUE(imputeZeroes)))
  on.exit(.Call(C_reading_close, reading))
  said <- jsonlite::fromJSON(answer_of(.Call(C_reading_facts, reading)), simplifyVector = TRUE)
  given <- attributes_of(said, isTRUE(imputeZeroes))
  if (isTRUE(asDataFrame)) {
    x <- .Call(C_reading_columns, reading)
    if (is.character(x)) answer_of(list(x))
    names(x) <- c("X", "Y", "Z", "time")
    attributes(x$time) <- list(class = c("POSIXct", "POSIXt"), tzone = "GMT")
    given$start_time <- start_of(given, x$time)
    attr(x, "row.names") <- .set_row_names(length(x$X))
    class(x) <- c("activity_df", "data.frame")
  } else {
    both <- .Call(C_reading_matrix, reading)
    if (is.character(both)) answer_of(list(both))
    x <- both[[1]]
    times <- both[[2]]
    dimnames(x) <- list(NULL, c("X", "Y", "Z"))
    given$start_time <- start_of(given, times)
    attr(x, "time_index") <- as.integer(round((times - as.numeric(given$start_time)) * 100))
    class(x) <- c("activity", "matrix", "array")
  }
  for (name in names(given)) {
    attr(x, name) <- given[[name]]
  }
  if (isTRUE(verbose)) {
    message(nrow(x), " samples of ", given$header$`Serial Number`)
  }
  x
}

# .NET ticks, which a double holds to 0.1 ms.
time_of_ticks <- function(ticks) {
  if (is.null(ticks) || identical(ticks, "0")) {
    return(as.POSIXct(NA, tz = "GMT"))
  }
  as.POSIXct(as.numeric(ticks) / 1e7 - 62135596800, origin = "1970-01-01", tz = "GMT")
}

# Start Date; where there is none, the time of the first sample.
start_of <- function(given, times) {
  if (is.na(given$start_time)) .POSIXct(as.numeric(times[1]), tz = "GMT") else given$start_time
}

# What read.gt3x's answers carry.
attributes_of <- function(said, imputed) {
  info <- said$info
  facts <- said$facts
  number <- function(key) if (is.null(info[[key]])) NA_real_ else as.numeric(sub(",", ".", info[[key]], fixed = TRUE))
  header <- info
  for (key in c("Start Date", "Stop Date", "Last Sample Time", "Download Date")) {
    header[[key]] <- time_of_ticks(info[[key]])
  }
  for (key in c("Sample Rate", "Acceleration Scale", "Acceleration Min", "Acceleration Max", "Battery Voltage")) {
    if (!is.null(info[[key]])) header[[key]] <- number(key)
  }
  serial <- null_to_na(info[["Serial Number"]], "")
  header[["Serial Prefix"]] <- substr(serial, 1, 3)
  rate <- facts$sample_rate_hz
  gaps <- said$gaps
  if (facts$gap_count > NROW(gaps)) {
    warning("missingness has the first ", NROW(gaps), " of ", facts$gap_count, " gaps", call. = FALSE)
  }
  missing <- if (length(gaps) == 0) {
    data.frame(time = as.POSIXct(numeric(0), origin = "1970-01-01", tz = "GMT"), n_missing = integer(0))
  } else {
    data.frame(
      time = as.POSIXct(gaps$unix_start, origin = "1970-01-01", tz = "GMT"),
      n_missing = as.integer(gaps$seconds * rate)
    )
  }
  list(
    start_time = header[["Start Date"]],
    stop_time = header[["Stop Date"]],
    last_sample_time = header[["Last Sample Time"]],
    subject_name = info[["Subject Name"]],
    time_zone = info[["TimeZone"]],
    firmware = info[["Firmware"]],
    serial_prefix = header[["Serial Prefix"]],
    sample_rate = as.integer(round(rate)),
    impute_zeroes = imputed,
    old_version = identical(facts$form, "gt3x_old"),
    features = features_of(said),
    missingness = missing,
    total_records = facts$samples,
    bad_samples = FALSE,
    header = structure(header, class = c("gt3x_info", "list"))
  )
}

features_of <- function(said) {
  kinds <- said$gaps$kind
  if (any(kinds == "idle_sleep")) "sleep mode" else "none"
}

as.data.frame.activity <- function(x, ..., verbose = FALSE) {
  given <- attributes(x)
  start <- as.numeric(given$start_time)
  frame <- data.frame(
    X = x[, 1], Y = x[, 2], Z = x[, 3],
    time = as.POSIXct(start + given$time_index / 100, origin = "1970-01-01", tz = "GMT")
  )
  for (name in setdiff(names(given), c("dim", "dimnames", "class", "time_index"))) {
    attr(frame, name) <- given[[name]]
  }
  class(frame) <- c("activity_df", "data.frame")
  frame
}

print.activity <- function(x, ...) {
  said_above(x)
  print(head(unclass(x)[, , drop = FALSE], ...))
  invisible(x)
}

print.activity_df <- function(x, ...) {
  said_above(x)
  print(head(structure(x, class = "data.frame"), ...))
  invisible(x)
}

said_above <- function(x) {
  cat("Sampling Rate: ", attr(x, "sample_rate"), "Hz\n", sep = "")
  cat("Firmware Version: ", attr(x, "firmware"), "\n", sep = "")
  cat("Serial Number Prefix: ", attr(x, "serial_prefix"), "\n", sep = "")
}

head.activity <- function(x, ...) keep_attributes(utils::head(unclass(x)[, , drop = FALSE], ...), x)

head.activity_df <- function(x, ...) {
  keep_attributes(utils::head(structure(x, class = "data.frame"), ...), x)
}

keep_attributes <- function(part, whole) {
  own <- c("dim", "dimnames", "names", "row.names", "time_index")
  for (name in setdiff(names(attributes(whole)), own)) {
    attr(part, name) <- attr(whole, name)
  }
  part
}
