# Makes a C++ source of the page's files: cmake -D FOLDER=... -D OUTPUT=... -P SixpointEmbed.cmake
set(text "// Made by cmake/SixpointEmbed.cmake from station/web.\n#include \"station/page/api.h\"\n\n")
string(APPEND text "namespace sixpoint::station {\nnamespace {\n")
set(cases "")
foreach(entry
    "src/index.html|/|text/html; charset=utf-8" "dist/page.js|/page.js|text/javascript; charset=utf-8"
    "dist/page.css|/page.css|text/css; charset=utf-8" "src/icon.svg|/icon.svg|image/svg+xml")
  string(REPLACE "|" ";" parts "${entry}")
  list(GET parts 0 file)
  list(GET parts 1 path)
  string(REGEX REPLACE "^[^|]*[|][^|]*[|]" "" type "${entry}")
  file(READ ${FOLDER}/${file} hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(MAKE_C_IDENTIFIER "k_${file}" name)
  string(APPEND text "constexpr unsigned char ${name}[] = {${bytes}0};\n")
  string(APPEND cases
    "  if (path == \"${path}\") {\n    return PageAsset{\"${type}\", {reinterpret_cast<const char*>(${name}), sizeof(${name}) - 1}};\n  }\n")
endforeach()
string(APPEND text "}  // namespace\n\nstd::optional<PageAsset> page_asset(std::string_view path) {\n")
string(APPEND text "${cases}  return std::nullopt;\n}\n\n}  // namespace sixpoint::station\n")
file(WRITE ${OUTPUT} "${text}")
