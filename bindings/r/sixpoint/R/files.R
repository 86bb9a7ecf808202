scan_16cpan03 <- function(paths, jobs = 0L, store = "") {
  json <- answer_of(.Call(C_scan_json, enc2native(paths), options_json(jobs = as.integer(jobs), store = path.expand(store))))
  document <- jsonlite::fromJSON(json, simplifyVector = FALSE)
  files <- document$files
  text <- function(key) vapply(files, function(file) null_to_na(file[[key]], NA_character_), "")
  frame <- data.frame(
    path = text("path"), verdict = text("verdict"), serial = text("serial"),
    firmware = text("firmware"), calibration_time = text("calibration_time"),
    evidence_mg = vapply(files, function(file) as.numeric(null_to_na(file$evidence_mg, NA)), 0),
    axes_rotated = vapply(files, function(file) file$axes_rotated, NA),
    reasons = I(lapply(files, function(file) unlist(file$reasons)))
  )
  attr(frame, "summary") <- unlist(document$summary)
  frame
}

repair_16cpan03 <- function(paths, output, constants = "", calibration_file = "", scan = FALSE,
                            store = "", or_scan = FALSE, no_pool = FALSE, wide = FALSE,
                            store_only = FALSE,
                            undo_rotation = FALSE, allow_prior = FALSE, salvage = FALSE,
                            force = FALSE, dry_run = FALSE, resume = FALSE,
                            redo_outdated = FALSE, link_unaffected = "", jobs = 0L) {
  options <- options_json(
    constants = path.expand(constants), calibration_file = path.expand(calibration_file),
    scan = scan, store = path.expand(store),
    or_scan = or_scan, no_pool = no_pool, wide = wide, store_only = store_only,
    undo_rotation = undo_rotation,
    allow_prior = allow_prior, salvage = salvage, force = force, dry_run = dry_run,
    resume = resume, redo_outdated = redo_outdated, link_unaffected = link_unaffected,
    jobs = as.integer(jobs)
  )
  document <- jsonlite::fromJSON(
    answer_of(.Call(C_repair_json, enc2native(paths), enc2native(output), options)),
    simplifyVector = FALSE
  )
  files <- document$files
  text <- function(key) vapply(files, function(file) null_to_na(file[[key]], NA_character_), "")
  number <- function(value) as.numeric(null_to_na(value, NA))
  frame <- data.frame(
    input = text("input"), output = text("output"), linked = text("linked"), status = text("status"), method = text("method"),
    serial = text("serial"), samples = vapply(files, function(file) number(file$samples), 0),
    clipped_before = vapply(files, function(file) number(file$clipped_before), 0),
    clipped_after = vapply(files, function(file) number(file$clipped_after), 0),
    still_error_before_mg = vapply(files, function(file) number(file$still_error_mg$before), 0),
    still_error_after_mg = vapply(files, function(file) number(file$still_error_mg$after), 0),
    input_sha256 = text("input_sha256"), output_sha256 = text("output_sha256"),
    reasons = I(lapply(files, function(file) unlist(file$reasons)))
  )
  attr(frame, "summary") <- unlist(document$summary)
  frame
}
