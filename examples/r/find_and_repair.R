# Finds affected recordings in a folder, repairs them, and shows ENMO before and after.
#   Rscript find_and_repair.R FOLDER OUTPUT
library(sixpoint)
arguments <- commandArgs(trailingOnly = TRUE)
folder <- arguments[1]
output <- arguments[2]

# Which files are affected?
found <- scan_16cpan03(folder)
cat(sum(found$verdict == "affected"), "of", nrow(found), "files are affected\n")

# Repair them with constants from their own still periods.
result <- repair_16cpan03(found$path[found$verdict == "affected"], output, scan = TRUE)
print(result[c("input", "status", "still_error_before_mg", "still_error_after_mg")])

# ENMO: what the acceleration's magnitude has beyond 1 g, on average over a minute.
enmo_mg <- function(path) {
  x <- read_gt3x_sixpoint(path, asDataFrame = TRUE, imputeZeroes = TRUE)
  minute <- floor(as.numeric(x$time - x$time[1], units = "mins"))
  beyond <- pmax(sqrt(x$X^2 + x$Y^2 + x$Z^2) - 1, 0)
  tapply(1000 * beyond, minute, mean)
}

# A picture for each repaired file.
for (i in which(result$status == "repaired")) {
  before <- enmo_mg(result$input[i])
  after <- enmo_mg(result$output[i])
  cat(result$serial[i], ": ENMO", mean(before), "mg before,", mean(after), "mg after\n")
  png(sub("gt3x$", "png", result$output[i]), width = 900, height = 300, type = "cairo")
  plot(before, type = "l", xlab = "minutes", ylab = "ENMO in mg", main = result$serial[i])
  lines(after, col = "blue")
  dev.off()
}
