# For Doxygen: the comment before a header's namespace tells of the file. Lines keep their numbers.
function flush(before) {
  if (blank) print before
  printf "%s", comment
  blank = 0
  comment = ""
}
/^$/ { flush(""); blank = 1; next }
/^\/\/\// { comment = comment $0 "\n"; next }
{ flush(comment != "" && /^namespace / ? "/// @file" : ""); print }
END { flush("") }
