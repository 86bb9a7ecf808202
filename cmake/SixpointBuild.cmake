cmake_minimum_required(VERSION 3.25)

# Run at every build (cmake -P): writes the commit that is built into a header, which changes only
# when the commit does. Outside of a git checkout the text is empty.
execute_process(COMMAND git --no-optional-locks -C ${SOURCE} describe --always --dirty --abbrev=12
  OUTPUT_VARIABLE build OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
if(failed)
  set(build "")
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "#define SIXPOINT_BUILD \"@build@\"\n" @ONLY)
