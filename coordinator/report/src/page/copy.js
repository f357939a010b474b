// Copies a line, and confirms it on its button.
for (const button of document.querySelectorAll("button.copy")) {
  const line = button.parentElement.querySelector(".line");
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(line.textContent);
      button.textContent = "Copied";
    } catch {
      // Without a clipboard, selects the line instead.
      getSelection().selectAllChildren(line);
      button.textContent = "Selected";
    }
    setTimeout(() => (button.textContent = "Copy"), 1500);
  });
}
