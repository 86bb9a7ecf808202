// The page's texts in the language that was chosen.
import { EN, type Strings } from './english';
import { DE } from './german';

export const LANGUAGES: Record<string, string> = { en: 'English', de: 'Deutsch' };

// The browser's language, until another one is chosen on the page.
export const language = (() => {
  const chosen = localStorage.getItem('sixpoint-language') ?? navigator.language.slice(0, 2);
  return chosen in LANGUAGES ? chosen : 'en';
})();
export function chooseLanguage(name: string) {
  localStorage.setItem('sixpoint-language', name);
  location.reload();
}
export const S: Strings = language === 'de' ? DE : EN;
document.documentElement.lang = language;
