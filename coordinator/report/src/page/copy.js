// Copies a line, and says so on its button.
for (const button of document.querySelectorAll("button.copy")) {
  const line = button.parentElement.querySelector(".line");
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(line.textContent);
      button.textContent = "Copied";
    } catch {
      // Without a clipboard the line is at least selected.
      getSelection().selectAllChildren(line);
      button.textContent = "Selected";
    }
    setTimeout(() => (button.textContent = "Copy"), 1500);
  });
}
