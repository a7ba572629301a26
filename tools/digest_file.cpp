#include "tools/digest_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string_view>

#include <fmt/format.h>

#include "io/errors.h"

namespace varve::tools {
namespace {

constexpr std::string_view magic = "varve-digest 1";
constexpr std::uint64_t file_bytes_max = 64u << 20;

std::string escape(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\\\";
    else if (c == '\n')
      out += "\\n";
    else if (c == '\r')
      out += "\\r";
    else
      out += c;
  }
  return out;
}

std::string unescape(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '\\' || i + 1 == text.size()) {
      out += text[i];
      continue;
    }
    const char c = text[++i];
    out += c == 'n' ? '\n' : c == 'r' ? '\r' : c;
  }
  return out;
}

// Reads a digest file line by line; every complaint names file and line.
class Parser {
 public:
  Parser(const std::string& text, std::string path) : path_(std::move(path)) {
    std::size_t start = 0;
    while (start < text.size()) {
      const std::size_t end = text.find('\n', start);
      if (end == std::string::npos)
        fail(lines_.size() + 1, "the last line is cut off: no line end");
      std::string_view line(text.data() + start, end - start);
      if (line.ends_with('\r')) line.remove_suffix(1);
      lines_.push_back(line);
      start = end + 1;
    }
  }

  DigestFile parse() {
    if (lines_.empty() || lines_[0] != magic) fail(1, fmt::format("expected '{}'", magic));
    check_end();
    out_.path = path_;
    for (at_ = 1; at_ + 1 < lines_.size(); ++at_) parse_line(lines_[at_]);
    if (out_.lines.empty()) fail(lines_.size(), "no step is listed");
    for (const auto& [seen, name] :
         {std::pair{has_engine_, "engine"}, {has_scenario_, "scenario"}, {has_schema_, "schema"}})
      if (!seen) fail(lines_.size(), fmt::format("'{}' is missing", name));
    return std::move(out_);
  }

 private:
  [[noreturn]] void fail(std::size_t line, const std::string& text) const {
    throw io::LogError(io::ErrorKind::damaged, path_, fmt::format("line {}: {}", line, text));
  }

  void check_end() {
    std::string before;
    for (std::size_t i = 0; i + 1 < lines_.size(); ++i) (before += lines_[i]) += '\n';
    const std::string expected = "end " + io::digest_text(before).hex();
    if (!lines_.back().starts_with("end "))
      fail(lines_.size(), "the file is cut off: no 'end' line");
    if (lines_.back() != expected)
      fail(lines_.size(), "the digest of the lines above does not hold: the file was altered");
  }

  void parse_line(std::string_view line) {
    const std::size_t space = line.find(' ');
    const std::string_view word = line.substr(0, space);
    const std::string_view rest = space == line.npos ? "" : line.substr(space + 1);
    if (word == "engine") {
      const std::size_t split = rest.rfind(' ');
      if (split == rest.npos) fail(at_ + 1, "expected 'engine NAME REVISION'");
      out_.engine = unescape(rest.substr(0, split));
      out_.engine_revision = static_cast<std::uint32_t>(whole(rest.substr(split + 1), 0xffffffff));
      has_engine_ = true;
    } else if (word == "scenario") {
      out_.scenario = digest(rest);
      has_scenario_ = true;
    } else if (word == "schema") {
      out_.schema = digest(rest);
      has_schema_ = true;
    } else if (word == "every") {
      out_.every = whole(rest, ~std::uint64_t{0});
    } else if (word == "reason") {
      out_.reason = unescape(rest);
    } else if (word == "param") {
      const std::size_t split = rest.find(' ');
      out_.parameters.emplace_back(rest.substr(0, split),
                                   split == rest.npos ? "" : unescape(rest.substr(split + 1)));
    } else if (word == "step") {
      parse_step(rest);
    } else if (!word.starts_with('#')) {
      fail(at_ + 1, fmt::format("unknown line '{}'", word));
    }
  }

  void parse_step(std::string_view rest) {
    std::array<std::string_view, 3> parts;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t space = i == 2 ? rest.npos : rest.find(' ');
      parts[i] = rest.substr(0, space);
      rest = space == rest.npos ? "" : rest.substr(space + 1);
    }
    DigestLine line;
    line.step = whole(parts[0], ~std::uint64_t{0});
    const auto end = std::from_chars(parts[1].data(), parts[1].data() + parts[1].size(), line.time);
    if (end.ec != std::errc{} || end.ptr != parts[1].data() + parts[1].size())
      fail(at_ + 1, fmt::format("'{}' is not a time in seconds", parts[1]));
    line.chain = digest(parts[2]);
    if (!out_.lines.empty() && line.step <= out_.lines.back().step)
      fail(at_ + 1,
           fmt::format("step {} does not follow step {}", line.step, out_.lines.back().step));
    out_.lines.push_back(line);
  }

  std::uint64_t whole(std::string_view text, std::uint64_t largest) const {
    std::uint64_t value = 0;
    const auto end = std::from_chars(text.data(), text.data() + text.size(), value);
    if (end.ec != std::errc{} || end.ptr != text.data() + text.size() || value > largest)
      fail(at_ + 1, fmt::format("'{}' is not a whole number", text));
    return value;
  }

  io::Digest digest(std::string_view text) const {
    const auto value = io::Digest::from_hex(text);
    if (!value) fail(at_ + 1, fmt::format("'{}' is not a digest (32 hexadecimal digits)", text));
    return *value;
  }

  std::string path_;
  std::vector<std::string_view> lines_;
  std::size_t at_ = 0;
  bool has_engine_ = false, has_scenario_ = false, has_schema_ = false;
  DigestFile out_;
};

std::ifstream open_for_reading(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error))
    throw io::LogError(io::ErrorKind::not_found, path, "is a folder; a file is needed");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw io::LogError(io::ErrorKind::not_found, path, "no such file, or not readable");
  return file;
}

}  // namespace

const DigestLine* DigestFile::find(std::uint64_t step) const {
  const auto at =
      std::lower_bound(lines.begin(), lines.end(), step,
                       [](const DigestLine& line, std::uint64_t s) { return line.step < s; });
  return at != lines.end() && at->step == step ? &*at : nullptr;
}

io::Digest scenario_digest(const io::Genesis& genesis) {
  if (genesis.files.empty()) return io::digest_text(genesis.scenario);
  std::string all = genesis.scenario;
  for (const auto& [name, content] : genesis.files)
    all += fmt::format("\n{} {} {}\n", name.size(), name, content.size()) + content;
  return io::digest_text(all);
}

DigestFile make_digest_file(const io::LogReader& log, std::uint64_t every) {
  const io::Genesis& genesis = log.genesis();
  DigestFile out;
  out.engine = genesis.engine;
  out.engine_revision = genesis.engine_revision;
  out.scenario = scenario_digest(genesis);
  out.schema = io::chain_base(genesis.schema);
  out.every = every;
  out.parameters = genesis.parameters;
  const std::uint64_t first = log.first_step(), last = log.last_step();
  const auto add = [&](std::uint64_t step) {
    // A salvaged log has gaps; what it does not hold can't be a reference.
    if (const auto header = log.header(step))
      out.lines.push_back({header->step, header->time, header->chain});
  };
  add(first);
  // Counted in quotients, so that the last multiple below 2^64 ends the loop.
  for (std::uint64_t k = first / every + 1; k <= last / every; ++k)
    if (k * every != last) add(k * every);
  if (last != first) add(last);
  return out;
}

std::string digest_file_text(const DigestFile& file) {
  std::string out = std::string(magic) + "\n";
  out += fmt::format("engine {} {}\n", escape(file.engine), file.engine_revision);
  out += fmt::format("scenario {}\nschema {}\n", file.scenario.hex(), file.schema.hex());
  out += fmt::format("every {}\n", file.every);
  if (!file.reason.empty()) out += fmt::format("reason {}\n", escape(file.reason));
  for (const auto& [key, value] : file.parameters)
    out += fmt::format("param {} {}\n", key, escape(value));
  for (const DigestLine& line : file.lines)
    out += fmt::format("step {} {} {}\n", line.step, line.time, line.chain.hex());
  return out + "end " + io::digest_text(out).hex() + "\n";
}

DigestFile parse_digest_file(const std::string& text, const std::string& path) {
  return Parser(text, path).parse();
}

bool is_digest_file(const std::string& path) {
  std::ifstream file = open_for_reading(path);
  std::array<char, magic.size()> start{};
  file.read(start.data(), start.size());
  // "varve-digest" of any version: an unknown one is then refused by name, not called "no log".
  constexpr std::size_t word = magic.find(' ');
  return file.gcount() >= static_cast<std::streamsize>(word) &&
         std::string_view(start.data(), word) == magic.substr(0, word);
}

DigestFile read_digest_file(const std::string& path) {
  std::ifstream file = open_for_reading(path);
  std::error_code error;
  if (std::filesystem::file_size(path, error) > file_bytes_max && !error)
    throw io::LogError(io::ErrorKind::limit, path,
                       fmt::format("larger than a digest file may be ({} bytes)", file_bytes_max));
  std::ostringstream text;
  text << file.rdbuf();
  return parse_digest_file(text.str(), path);
}

void write_digest_file(const DigestFile& file, const std::string& path, bool overwrite) {
  namespace fs = std::filesystem;
  if (fs::is_directory(path))
    throw io::LogError(io::ErrorKind::exists, path, "is a folder; a file is needed");
  if (!overwrite && fs::is_regular_file(path))
    throw io::LogError(io::ErrorKind::exists, path, "exists already; --overwrite replaces it");
  const std::string text = digest_file_text(file);
  // Devices such as /dev/stdout can't be renamed onto.
  const bool direct = fs::exists(path) && !fs::is_regular_file(path);
  const std::string target = direct ? path : path + ".tmp";
  std::FILE* out = std::fopen(target.c_str(), "wb");
  if (out == nullptr) throw io::LogError(io::ErrorKind::write_failed, path, "can't be created");
  const bool written = std::fwrite(text.data(), 1, text.size(), out) == text.size();
  const bool closed = std::fclose(out) == 0;
  std::error_code error;
  if (written && closed && !direct) fs::rename(target, path, error);
  if (written && closed && !error) return;
  if (!direct) std::remove(target.c_str());
  throw io::LogError(io::ErrorKind::write_failed, path,
                     fmt::format("{} bytes could not be written", text.size()));
}

bool is_output_key(std::string_view key) {
  return key == "scenario.title" || key.starts_with("record.") || key == "time.until" ||
         key == "time.steps";
}

std::vector<KeyDifference> compare_keys(const std::vector<std::pair<std::string, std::string>>& a,
                                        const std::vector<std::pair<std::string, std::string>>& b) {
  const auto lookup = [](const auto& list, const std::string& key) {
    return std::find_if(list.begin(), list.end(), [&](const auto& e) { return e.first == key; });
  };
  std::vector<KeyDifference> out;
  for (const auto& [key, value] : a) {
    const auto other = lookup(b, key);
    if (other == b.end())
      out.push_back({key, value, "(not set)"});
    else if (other->second != value)
      out.push_back({key, value, other->second});
  }
  for (const auto& [key, value] : b)
    if (lookup(a, key) == a.end()) out.push_back({key, "(not set)", value});
  return out;
}

}  // namespace varve::tools
