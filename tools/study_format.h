// The format of study files as text: tools/study_format.txt, embedded when varve was built.
#pragma once

#include <string_view>

namespace varve::tools {

extern const std::string_view study_format;

}  // namespace varve::tools
