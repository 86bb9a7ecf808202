# How long the R package takes to read a recording, against inflating it.
#
#   Rscript bench/r_read.R RECORDING [ROUNDS]
#
# The baseline of the same run: libdeflate inflates log.bin (bench/python_read.py). Both are told as the best of the
# rounds, each in a process of its own, with the most memory it had.
arguments <- commandArgs(trailingOnly = TRUE)
if (identical(arguments[1], "--work")) {
  library(sixpoint)
  seconds <- system.time(x <- read_gt3x_sixpoint(arguments[2], asDataFrame = TRUE))[["elapsed"]]
  most_kb <- as.numeric(gsub("[^0-9]", "", grep("^VmHWM", readLines("/proc/self/status"), value = TRUE)))
  cat(seconds, most_kb / 1e6, nrow(x), "\n")
  quit()
}
path <- arguments[1]
rounds <- if (length(arguments) > 1) as.integer(arguments[2]) else 3L
script <- sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE))
inflate <- function() {
  as.numeric(system2("python3", c(file.path(dirname(script), "python_read.py"), "--work", "inflate", path), stdout = TRUE))
}
read <- function() {
  as.numeric(strsplit(system2("Rscript", c(script, "--work", path), stdout = TRUE), " ")[[1]])
}
inflate_s <- min(replicate(rounds, inflate()))
runs <- replicate(rounds, read())
best <- runs[, which.min(runs[1, ])]
cat(sprintf("inflate %.3f s\nread_gt3x_sixpoint %.3f s, %.2f of inflate, %.0f rows, most memory %.2f GB\n", inflate_s,
            best[1], best[1] / inflate_s, best[3], max(runs[2, ])))
