#include "tools/embedded_files.h"

#include <algorithm>

namespace varve::tools {
namespace {

constexpr std::string_view head = "#embedded file: ", whole_line = "#|", cut_line = "#:";

}  // namespace

std::string with_embedded(std::string_view scenario, const NamedFiles& files) {
  std::string text(scenario);
  for (const auto& [name, content] : files) {
    if (!text.empty() && text.back() != '\n') text += '\n';
    text += std::string(head) + name + '\n';
    for (std::string_view rest = content; !rest.empty();) {
      const std::size_t end = rest.find('\n');
      text += end == rest.npos ? cut_line : whole_line;
      text += rest.substr(0, end);
      text += '\n';
      rest.remove_prefix(end == rest.npos ? rest.size() : end + 1);
    }
  }
  return text;
}

SplitScenario split_embedded(std::string_view text) {
  SplitScenario split;
  std::size_t begin = 0;
  if (!text.starts_with(head)) {
    const std::size_t found = text.find("\n" + std::string(head));
    begin = found == text.npos ? text.size() : found + 1;
  }
  split.scenario = text.substr(0, begin);
  int line = 1 + static_cast<int>(std::count(text.begin(), text.begin() +
                                             static_cast<std::ptrdiff_t>(begin), '\n'));
  for (std::string_view rest = text.substr(begin); !rest.empty(); ++line) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string_view now = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (now.starts_with(head)) {
      split.files.emplace_back(now.substr(head.size()), "");
    } else if (now.starts_with(whole_line)) {
      split.files.back().second += std::string(now.substr(whole_line.size())) + '\n';
    } else if (now.starts_with(cut_line)) {
      split.files.back().second += now.substr(cut_line.size());
    } else {
      split.wrong_line = line;
      break;
    }
  }
  return split;
}

}  // namespace varve::tools
