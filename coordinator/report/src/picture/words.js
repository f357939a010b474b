// Numbers and what they count, in words.

// A number and its noun, which is given in the singular: `1 behaviour`, `2 behaviours`.
function counted(count, noun) {
  return `${count} ${noun}${count === 1 ? "" : "s"}`;
}
