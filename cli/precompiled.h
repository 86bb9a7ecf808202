// What every command includes, compiled once for all of them; a command still includes what it
// uses: the build with the sanitizers reads every file without this.
#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/App.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/logger.h>
#include <tl/expected.hpp>
