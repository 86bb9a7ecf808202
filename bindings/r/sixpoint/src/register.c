/* Between R and calls.h: values, errors, and Ctrl-C. */
#include <R.h>
#include <R_ext/Rdynload.h>
#include <Rinternals.h>
#include <stdlib.h>
#include <string.h>

#include "calls.h"

static void look(void* unused) {
  (void)unused;
  R_CheckUserInterrupt();
}

/* Other than 0 after Ctrl-C. R_CheckUserInterrupt() jumps; here it lands. */
static int stop_wanted(void) { return R_ToplevelExec(look, NULL) == FALSE; }

/* A string of R from a document, which is freed. */
static SEXP text_and_free(char* text) {
  SEXP value = PROTECT(Rf_mkString(text == NULL ? "" : text));
  free(text);
  UNPROTECT(1);
  return value;
}

/* list(error, answer): one of the two is NULL. */
static SEXP outcome(char* error, SEXP answer) {
  SEXP both = PROTECT(Rf_allocVector(VECSXP, 2));
  if (error != NULL) {
    SET_VECTOR_ELT(both, 0, text_and_free(error));
  } else {
    SET_VECTOR_ELT(both, 1, answer);
  }
  UNPROTECT(1);
  return both;
}

static void finalize_reading(SEXP pointer) {
  sixpoint_reading* reading = R_ExternalPtrAddr(pointer);
  if (reading != NULL) {
    sixpoint_reading_close(reading);
    R_ClearExternalPtr(pointer);
  }
}

static SEXP reading_open(SEXP path, SEXP fill) {
  SEXP pointer = PROTECT(R_MakeExternalPtr(NULL, R_NilValue, R_NilValue));
  R_RegisterCFinalizerEx(pointer, finalize_reading, TRUE);
  sixpoint_reading* reading = NULL;
  char* error = sixpoint_reading_open(R_ExpandFileName(CHAR(STRING_ELT(path, 0))),
                                      Rf_asLogical(fill), stop_wanted, &reading);
  R_SetExternalPtrAddr(pointer, reading);
  SEXP both = outcome(error, pointer);
  UNPROTECT(1);
  return both;
}

static sixpoint_reading* reading_of(SEXP pointer) {
  sixpoint_reading* reading = R_ExternalPtrAddr(pointer);
  if (reading == NULL) {
    Rf_error("the reading was closed");
  }
  return reading;
}

static SEXP reading_close(SEXP pointer) {
  finalize_reading(pointer);
  return R_NilValue;
}

/* What a call gave, or the text of its error. Not in an outcome(): that would hold the values, too,
   and R would copy them where it sets an attribute. */
static SEXP values_or_error(char* error, SEXP values) {
  return error == NULL ? values : text_and_free(error);
}

/* list(matrix n x 3 in g, times in s), or an error */
static SEXP reading_matrix(SEXP pointer) {
  sixpoint_reading* reading = reading_of(pointer);
  const double rows = sixpoint_reading_rows(reading);
  if (rows > 2147483647.0) {
    Rf_error("R has no matrix of %.0f rows", rows);
  }
  SEXP both = PROTECT(Rf_allocVector(VECSXP, 2));
  SET_VECTOR_ELT(both, 0, Rf_allocMatrix(REALSXP, (int)rows, 3));
  SET_VECTOR_ELT(both, 1, Rf_allocVector(REALSXP, (R_xlen_t)rows));
  double* values = REAL(VECTOR_ELT(both, 0));
  char* error = sixpoint_reading_columns(reading, values, values + (R_xlen_t)rows,
                                         values + 2 * (R_xlen_t)rows, REAL(VECTOR_ELT(both, 1)));
  SEXP given = values_or_error(error, both);
  UNPROTECT(1);
  return given;
}

/* list(X, Y, Z, times), or an error */
static SEXP reading_columns(SEXP pointer) {
  sixpoint_reading* reading = reading_of(pointer);
  SEXP all = PROTECT(Rf_allocVector(VECSXP, 4));
  for (int i = 0; i < 4; ++i) {
    SET_VECTOR_ELT(all, i, Rf_allocVector(REALSXP, (R_xlen_t)sixpoint_reading_rows(reading)));
  }
  char* error = sixpoint_reading_columns(reading, REAL(VECTOR_ELT(all, 0)), REAL(VECTOR_ELT(all, 1)),
                                         REAL(VECTOR_ELT(all, 2)), REAL(VECTOR_ELT(all, 3)));
  SEXP given = values_or_error(error, all);
  UNPROTECT(1);
  return given;
}

static SEXP reading_facts(SEXP pointer) {
  char* json = NULL;
  char* error = sixpoint_reading_facts(reading_of(pointer), &json);
  SEXP answer = PROTECT(error == NULL ? text_and_free(json) : R_NilValue);
  SEXP both = outcome(error, answer);
  UNPROTECT(1);
  return both;
}

static const char** paths_of(SEXP paths) {
  const char** all = (const char**)R_alloc((size_t)Rf_length(paths) + 1, sizeof(char*));
  for (int i = 0; i < Rf_length(paths); ++i) {
    const char* path = R_ExpandFileName(CHAR(STRING_ELT(paths, i)));
    char* kept = R_alloc(strlen(path) + 1, 1);
    strcpy(kept, path);
    all[i] = kept;
  }
  return all;
}

static SEXP scan_json(SEXP paths, SEXP options) {
  char* json = NULL;
  char* error = sixpoint_scan_json(paths_of(paths), Rf_length(paths), CHAR(STRING_ELT(options, 0)),
                                   stop_wanted, &json);
  SEXP answer = PROTECT(error == NULL ? text_and_free(json) : R_NilValue);
  SEXP both = outcome(error, answer);
  UNPROTECT(1);
  return both;
}

static SEXP repair_json(SEXP paths, SEXP folder, SEXP options) {
  char* json = NULL;
  const char** all = paths_of(paths);
  char* error = sixpoint_repair_json(all, Rf_length(paths), paths_of(folder)[0],
                                     CHAR(STRING_ELT(options, 0)), stop_wanted, &json);
  SEXP answer = PROTECT(error == NULL ? text_and_free(json) : R_NilValue);
  SEXP both = outcome(error, answer);
  UNPROTECT(1);
  return both;
}

static const R_CallMethodDef methods[] = {{"reading_open", (DL_FUNC)&reading_open, 2},
                                          {"reading_close", (DL_FUNC)&reading_close, 1},
                                          {"reading_matrix", (DL_FUNC)&reading_matrix, 1},
                                          {"reading_columns", (DL_FUNC)&reading_columns, 1},
                                          {"reading_facts", (DL_FUNC)&reading_facts, 1},
                                          {"scan_json", (DL_FUNC)&scan_json, 2},
                                          {"repair_json", (DL_FUNC)&repair_json, 3},
                                          {NULL, NULL, 0}};

void R_init_sixpoint(DllInfo* info) {
  R_registerRoutines(info, NULL, methods, NULL, NULL);
  R_useDynamicSymbols(info, FALSE);
}
