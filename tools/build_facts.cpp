// What this program was built from and runs on: shown by --version, recorded in genesis, never
// digested.
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include "tools/cli.h"

namespace varve::tools {
namespace {

std::string compiler() {
#if defined(__clang__)
  return fmt::format("clang++ {}.{}.{}", __clang_major__, __clang_minor__, __clang_patchlevel__);
#else
  return fmt::format("g++ {}.{}.{}", __GNUC__, __GNUC_MINOR__, __GNUC_PATCHLEVEL__);
#endif
}

std::string c_library() {
#if defined(__GLIBC__)
  return fmt::format("glibc {}.{}", __GLIBC__, __GLIBC_MINOR__);
#else
  return "unknown";
#endif
}

std::string cpu_features() {
#if defined(__x86_64__)
  std::string features = "sse2";
  if (__builtin_cpu_supports("avx")) features += " avx";
  if (__builtin_cpu_supports("avx2")) features += " avx2";
  if (__builtin_cpu_supports("fma")) features += " fma";
  if (__builtin_cpu_supports("avx512f")) features += " avx512f";
  return features;
#else
  return "unknown";
#endif
}

}  // namespace

std::string version_text() { return VARVE_VERSION; }

std::vector<std::pair<std::string, std::string>> build_facts() {
  utsname system{};
  uname(&system);
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  return {
      {"version", version_text()},
      {"compiler", compiler()},
      {"build", VARVE_BUILD_TYPE},
      {"flags", VARVE_FLAGS},
      {"c_library", c_library()},
      {"system", fmt::format("{} {}", system.sysname, system.machine)},
      {"cpu", cpu_features()},
      {"host", system.nodename},
      {"date", fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", utc.tm_year + 1900,
                           utc.tm_mon + 1, utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec)},
  };
}

}  // namespace varve::tools
