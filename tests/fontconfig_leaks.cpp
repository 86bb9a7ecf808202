// Fontconfig, under librsvg, pango and cairo, keeps its tables of fonts until the process ends: for
// the test programs that draw text.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libfontconfig"; }
