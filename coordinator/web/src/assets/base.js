// The path under which a proxy serves the pages; empty without one.
export const base = document.documentElement.dataset.base ?? "";
