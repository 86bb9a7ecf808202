/* What the R package calls: plain C, so that the package itself is compiled by any compiler of R.

   A function that returns `char *` returns NULL when it succeeded; else a JSON document {code,
   what, where, hint}, which the caller frees by free(). So are the documents that it gives through
   a pointer. `stop` is asked from time to time on the calling thread; where it says other than 0,
   the work ends, and the function fails with the code "stopped". */
#pragma once

#ifdef __cplusplus
extern "C" {
#endif

typedef int (*sixpoint_stop)(void);
typedef struct sixpoint_reading sixpoint_reading;

/* Reads all samples of a recording. fill: 0 what was recorded, in the order of the file; 1 missing
   seconds as zeros. */
char* sixpoint_reading_open(const char* path, int fill, sixpoint_stop stop, sixpoint_reading** out);
void sixpoint_reading_close(sixpoint_reading* reading);
double sixpoint_reading_rows(const sixpoint_reading* reading);
/* Fills columns of that many values. The first three: g, rounded to 0.001 half away from zero as in
   the vendor's CSV; the last: seconds since 1970 by the recording's clock, rounded to 0.01. */
char* sixpoint_reading_columns(const sixpoint_reading* reading, double* x_g, double* y_g,
                               double* z_g, double* times_s);
/* {"facts": as `sixpoint inspect`, "info": {...}, "gaps": [{unix_start, seconds, kind}]} */
char* sixpoint_reading_facts(const sixpoint_reading* reading, char** json);

/* As `sixpoint scan --json` and `sixpoint repair --json`; `options`: a JSON object. */
char* sixpoint_scan_json(const char* const* paths, int count, const char* options,
                         sixpoint_stop stop, char** json);
char* sixpoint_repair_json(const char* const* paths, int count, const char* folder,
                           const char* options, sixpoint_stop stop, char** json);

#ifdef __cplusplus
}
#endif
