# The answer of a call into the library: its value, or a condition of class "sixpoint_error" with the
# fields code, what, where and hint.
answer_of <- function(both) {
  if (is.null(both[[1]])) {
    return(both[[2]])
  }
  error <- jsonlite::fromJSON(both[[1]])
  if (identical(error$code, "stopped")) {
    # What Ctrl-C means to R.
    raise_interrupt()
  }
  where <- if (nzchar(error$where)) paste0(error$where, ": ") else ""
  hint <- if (nzchar(error$hint)) paste0("; ", error$hint) else ""
  stop(structure(
    class = c("sixpoint_error", "error", "condition"),
    c(list(message = paste0(where, error$what, hint), call = NULL), error)
  ))
}

raise_interrupt <- function() {
  condition <- structure(class = c("interrupt", "condition"), list(message = "", call = NULL))
  signalCondition(condition)
  invokeRestart("abort")
}

one_path <- function(path) {
  if (!is.character(path) || length(path) != 1 || is.na(path)) {
    stop("'path' must be the name of one file", call. = FALSE)
  }
  enc2native(path)
}

# Lists of R as the library takes options: scalars, not arrays.
options_json <- function(...) as.character(jsonlite::toJSON(list(...), auto_unbox = TRUE))

null_to_na <- function(value, na) if (is.null(value)) na else value
